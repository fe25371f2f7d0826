// stages/bead/contacts.h: where the pieces of a layer's beads touch those beside them, and what shape they have there.
//
// Two beads that reach each other share the room between their lines, as in neighbours.h: what would lie twice fills the cusps
// above and below the place where they touch; a cusp that is partly filled is round. What finds no room there goes to the other
// sides of both beads. No constant.
#pragma once

#include <span>

#include "stages/bead/laid.h"
#include "stages/data/buffer.h"

namespace lamina::bead {

/// One side of a piece.
struct PieceSide {
  double reach_mm;        // from the line to the side, where the piece is widest
  double corner_mm = -1;  // where it touches: the radius of the cusps above and below; below 0: it touches nothing
};

/// Both, as seen along the piece.
struct PieceSides {
  PieceSide left, right;
};

/// height_mm  of the layer
/// sides      one for each piece
/// returns    mm3 that found no room and are left out
/// cost       O(pieces x pieces within the widest bead's width of one), parallel; 100 bytes a piece. Same for any threads
double find_contacts(std::span<const LaidPiece> pieces, double height_mm, Buffer<PieceSides>& sides);

/// How far a side reaches at a height over or below the middle of the layer, mm; below 0: not at all.
double reach_at(const LaidPiece& piece, const PieceSide& side, double height_mm, double above_mm);

}  // namespace lamina::bead
