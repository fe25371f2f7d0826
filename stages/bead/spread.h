// stages/bead/spread.h: a bead spreads along its line as far as to its sides; volume is conserved.
//
// What leaves the nozzle at a place becomes a bead w wide, so the nozzle has pushed it w / 2 to both sides, and as far forwards
// and back: it lies in a disc of the diameter w. Thick stretches reach into thin ones by that, and lines end round. Assumed:
// the disc is of one height. No constant: the width is that of the bead without spread (section.h). The same round pen lays the
// beads of lamina's pictures and counts its pores.
#pragma once

#include <cstdint>
#include <functional>

#include "stages/bead/line.h"
#include "stages/data/buffer.h"

namespace lamina::bead {

/// A cell along the line after spreading, mm from where the line begins: those of a line's round start lie before 0.
struct SpreadCell {
  double begin_mm, end_mm;
  double volume_mm3;
  double area_mm2;  // volume / length
  double width_mm;  // between those of a pressed bead and a round thread by the shares of either (section.h)
};

using TakeCell = std::function<void(const SpreadCell&)>;

/// Takes the pieces of a line in order, gives cells as soon as nothing reaches them any more. Keeps 2 x reach / cell sums.
///
/// usage   add(piece, take)...; end(take); after which the next line begins at 0
class BeadSpread {
 public:
  /// height  of the layer, mm
  /// cell    mm, > 0
  /// reach   mm: half of the widest bead; what is wider is taken to spread so far
  BeadSpread(double height_mm, double cell_mm = 0.02, double reach_mm = 1.5);

  void add(const BeadPiece& piece, const TakeCell& take);
  void end(const TakeCell& take);

 private:
  struct Sum {
    double volume = 0, pressed = 0;  // mm3
  };
  void put(double place, double volume, bool pressed, double radius);
  void give_before(std::int64_t cell, const TakeCell& take);
  Sum& at(std::int64_t cell) { return ring_[static_cast<std::size_t>(cell + reach_cells_) % ring_.size()]; }

  double height_, cell_, reach_;
  std::int64_t reach_cells_, first_;  // the first cell that was not given
  bool begun_ = false;                // empty cells before the line are not given
  Buffer<Sum> ring_;
  std::int64_t last_;  // the last cell that holds anything
};

}  // namespace lamina::bead
