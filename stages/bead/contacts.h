// stages/bead/contacts.h: where the pieces of a layer's beads touch those beside them, and what shape they have there.
//
// Two beads that reach each other share the room between their lines, as in neighbours.h: what would lie twice fills the cusps
// above and below the place where they touch; a cusp that is partly filled is round. What finds no room there goes to the other
// sides of both beads. One constant: a free side takes a twentieth of its bead at a time.
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

/// What a piece has too much and what it could still hold, mm3: its half of open cusps, and a twentieth of what it is where a
/// side is free.
struct PieceRoom {
  double over = 0, room = 0;
};

/// height_mm  of the layer
/// sides      one for each piece
/// rooms      one for each piece; none: not told
/// returns    mm3 that found no room and are left out
/// cost       O(pieces x pieces within the widest bead's width of one), parallel; 100 bytes a piece. Same for any threads
double find_contacts(std::span<const LaidPiece> pieces, double height_mm, Buffer<PieceSides>& sides,
                     Buffer<PieceRoom>* rooms = nullptr);

/// How far a side reaches at a height over or below the middle of the layer, mm; below 0: not at all.
double reach_at(const LaidPiece& piece, const PieceSide& side, double height_mm, double above_mm);

}  // namespace lamina::bead
