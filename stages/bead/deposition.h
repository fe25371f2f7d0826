// stages/bead/deposition.h: predicts the deposited beads of a layer from the commands of a toolpath file.
//
// A line is a chain of moves deposited without a stop: it is fed along its whole length (line.h) and may spread along it
// (spread.h). At a bend the head slows down to the speed at which its velocity changes by what the machine changes at once (the
// classic jerk of Marlin's planner). Assumed: the melt has the state of the end of the previous line when a line begins, plus
// what was fed in between: retractions are made for that; how well they work is unknown. The first line begins with the flow of
// its own initial speed, and so does a line after a feed that no flow of a line explains (a purge).
#pragma once

#include <span>

#include "stages/bead/line.h"
#include "stages/data/buffer.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/toolpaths.h"

namespace lamina::bead {

struct DepositionRules {
  BeadMachine machine;     // its area does not count: what is fed does; lines of a stated acceleration keep to that
  double corner_mm_s = 8;  // the change of velocity that is made at once, > 0
  double feed_ratio = 1;   // what is fed / what is commanded
  double height_mm = 0.2;  // of the layer, > 0
  double piece_mm = 0.02;  // length of pieces, > 0
  double usual_mm_s = 40;  // of beads whose speed the file does not state
  Box within;              // pieces that do not reach into it are left out; empty: all are kept
  bool spread = false;     // along the line too: lines end round then, and reach beyond their ends
};

/// A piece of a bead that is straight and has one cross-section.
struct DepositedPiece {
  Point2 from, to;            // nm on the bed
  double area_mm2, width_mm;  // of the bead without neighbours
};

/// beads, feeds  of one layer, in the order of printing, as many of each
/// out           pieces in the same order, no wider than 3 mm
/// cost          with spread, two thousand numbers from a table for a mm of line
void deposit(std::span<const DepositedBead> beads, std::span<const BeadFeed> feeds, const DepositionRules& rules,
             Buffer<DepositedPiece>& out);

// --- contacts between neighbouring pieces of a layer's beads, and the shape of the sides.
//
// Two beads that reach each other share the space between their lines, as in neighbours.h: the volume of their overlap fills
// the cusps above and below the contact; a partly filled cusp is round. Volume that does not fit there goes to the other sides
// of both beads. One constant: a free side takes a twentieth of its bead at a time.

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
/// sides, clearances  one for each piece
/// returns    mm3 that did not fit and are left out
/// cost       O(pieces x pieces within the widest bead's width of one), parallel; 100 bytes a piece. Same for any threads
double find_contacts(std::span<const DepositedPiece> pieces, double height_mm, Buffer<PieceSides>& sides,
                     Buffer<PieceClearance>& clearances);

/// How far a side reaches at a height over or below the middle of the layer, mm; below 0: not at all.
double reach_at(const DepositedPiece& piece, const PieceSide& side, double height_mm, double above_mm);

// --- melt that does not fit between its neighbours flows along its own line.
//
// If two neighbours leave no space, melt is pushed along the line, half of it forwards and half back, to the nearest positions
// where cusps are open or a side is free. Volume is kept. Assumed: it flows equally easily at any distance. A free side takes a
// twentieth of its bead in each of eight rounds (find_contacts), which limits how far the surplus is levelled; no measurement
// determined that limit.

/// pieces   of a layer in the order of printing; those that follow each other without a gap are a line. Areas and widths change
///          where melt leaves or comes
/// sides    one for each piece, as find_contacts() has them afterwards
/// returns  mm3 that find no room on their whole line and are left out
/// cost     that of find_contacts(), up to nine times where there is no room. Same for any threads
double flow_along(std::span<DepositedPiece> pieces, double height_mm, Buffer<PieceSides>& sides);

}  // namespace lamina::bead
