// stages/bead/contacts.h: contacts between neighbouring pieces of a layer's beads, and the shape of the sides.
//
// Two beads that reach each other share the space between their lines, as in neighbours.h: the volume of their overlap fills
// the cusps above and below the contact; a partly filled cusp is round. Volume that does not fit there goes to the other sides
// of both beads. One constant: a free side takes a twentieth of its bead at a time.
#pragma once

#include <span>

#include "stages/bead/deposition.h"
#include "stages/data/buffer.h"

namespace lamina::bead {

/// One side of a piece.
struct PieceSide {
  double reach_mm;        // from the line to the side, where the piece is widest
  double corner_mm = -1;  // where it touches: the radius of the cusps above and below; below 0: it touches nothing
};

/// Both sides, viewed along the piece.
struct PieceSides {
  PieceSide left, right;
};

/// What a piece has too much and what it could still hold, mm3: its half of open cusps, and a twentieth of what it is where a
/// side is free.
struct PieceClearance {
  double over = 0, clearance = 0;
};

/// height_mm  of the layer
/// sides      one for each piece
/// clearances  one for each piece; null: not reported
/// returns    mm3 that did not fit and are left out
/// cost       O(pieces x pieces within the widest bead's width of one), parallel; 100 bytes a piece. Same for any threads
double find_contacts(std::span<const DepositedPiece> pieces, double height_mm, Buffer<PieceSides>& sides,
                     Buffer<PieceClearance>* clearances = nullptr);

/// How far a side reaches at a height over or below the middle of the layer, mm; below 0: not at all.
double reach_at(const DepositedPiece& piece, const PieceSide& side, double height_mm, double above_mm);

// --- melt that does not fit between its neighbours flows along its own line.
//
// If two neighbours leave no space, melt is pushed along the line, half of it forwards and half back, to the nearest positions
// where cusps are open or a side is free. Volume is kept. Assumed: it flows equally easily at any distance. A free side takes a
// twentieth of its bead in each of eight rounds (contacts.h), which limits how far the surplus is levelled; no measurement
// determined that limit.

/// pieces   of a layer in the order of printing; those that follow each other without a gap are a line. Areas and widths change
///          where melt leaves or comes
/// sides    one for each piece, as find_contacts() has them afterwards
/// returns  mm3 that find no room on their whole line and are left out
/// cost     that of find_contacts(), up to nine times where there is no room. Same for any threads
double flow_along(std::span<DepositedPiece> pieces, double height_mm, Buffer<PieceSides>& sides);

}  // namespace lamina::bead
