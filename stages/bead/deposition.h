// stages/bead/deposition.h: predicts the deposited beads of a layer from the commands of a toolpath file.
//
// A line is a chain of moves deposited without a stop: it is fed along its whole length (line.h) and may spread along it
// (spread.h). At a bend the head slows down to the speed at which its velocity changes by what the machine changes at once (the
// classic jerk of Marlin's planner). Assumed: the melt has the state of the end of the previous line when a line begins, plus
// what was fed in between: retractions are made for that; how well they work is unknown. The first line begins with the flow of
// its own initial speed, and so does a line after a feed that no flow of a line explains (a purge).
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

}  // namespace lamina::bead
