// stages/bead/deposition.h: the beads of a layer as they come to lie, predicted from what a toolpath file commands.
//
// A line is what is laid without a stop: it is fed along its whole way (line.h) and may spread along it (spread.h). At a bend
// the head slows down to the speed at which the change of its velocity is that which the machine makes at once (the classic
// jerk of Marlin's planner). Assumed: what the melt held when a line ended it holds when the next one begins, and what was fed
// in between in addition: retractions are made for that, and nothing is known of how well they do. The first line of all begins
// with the flow of the speed with which it begins, and so does one behind a feed that no flow of a line explains (a purge).
#pragma once

#include <span>

#include "stages/bead/machine.h"
#include "stages/data/buffer.h"
#include "stages/data/mesh.h"  // Box
#include "stages/data/toolpaths.h"

namespace lamina::bead {

struct DepositionRules {
  BeadMachine machine;     // its area does not count: what is fed does
  double corner_mm_s = 8;  // the change of velocity that is made at once, > 0
  double feed_ratio = 1;   // what is fed / what is commanded
  double height_mm = 0.2;  // of the layer, > 0
  double piece_mm = 0.02;  // length of pieces, > 0
  double usual_mm_s = 40;  // of beads whose speed the file does not tell
  Box within;              // pieces that do not reach into it are left out; empty: all are laid
  bool spread = false;     // along the line too: lines end round then, and reach beyond their ends
};

/// A piece of a bead that is straight and has one cross-section.
struct DepositedPiece {
  Point2 from, to;            // nm on the bed
  double area_mm2, width_mm;  // alone: of the bead that nothing is beside
};

/// beads, feeds  of one layer, in the order of printing, as many of each
/// out           pieces in the same order, no wider than 3 mm
/// cost          with spread, two thousand numbers from a table for a mm of line
void deposit(std::span<const DepositedBead> beads, std::span<const BeadFeed> feeds, const DepositionRules& rules,
             Buffer<DepositedPiece>& out);

}  // namespace lamina::bead
