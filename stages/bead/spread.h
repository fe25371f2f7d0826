// stages/bead/spread.h: a bead spreads along its line while the nozzle is near; volume is conserved.
//
// Melt between nozzle and layer flows as in a Hele-Shaw cell: velocity = - gradient of a potential, which is the same all along
// its free edge. A nozzle that moves evenly pushes a finger of the width w before it, of which it has formed, a way s behind
// it,
//
//   y = w / pi x arccos(exp(-pi s / w) / 2) to both sides,  from s = - w ln 2 / pi, the tip, on:
//
// with the nozzle at 0 and q in the unit disc, z = w / pi x ln(1 + q) and the potential Re ln q are the exact solution: the
// edge moves with the nozzle's speed. Two thirds of the width are formed under the nozzle, 99 % a width behind it: so far what
// leaves the nozzle at a place widens the bead around it. Thick stretches reach into the thin ones at both their sides, and
// lines end round. The same kernel is used where flow and speed change, with the width of the moment. Assumed: the nozzle's
// flat end is as large as that and does not drag the melt along. No constant.
//
// S. Richardson, Hele Shaw flows with a free boundary produced by the injection of fluid into a narrow channel, J. Fluid Mech.
// 56, 1972: the law. P. G. Saffman and G. I. Taylor, Proc. R. Soc. A 245, 1958: fingers of that shape, log cos.
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
  double width_mm;  // between those of a pressed bead and a round thread by the shares of either (line.h)
};

using TakeCell = std::function<void(const SpreadCell&)>;

/// Takes the pieces of a line in order, gives cells as soon as nothing reaches them any more. Keeps 2 x reach / cell sums.
///
/// usage   add(piece, take)...; end(take); after which the next line begins at 0
class BeadSpread {
 public:
  /// height  of the layer, mm
  /// cell    mm, > 0
  /// reach   mm: half of the widest bead; what is wider spreads as that
  BeadSpread(double height_mm, double cell_mm = 0.02, double reach_mm = 1.5);

  void add(const BeadPiece& piece, const TakeCell& take);
  void end(const TakeCell& take);

 private:
  struct Sum {
    double volume = 0, pressed = 0;  // mm3
  };
  void put(double begin_mm, double end_mm, double volume, bool pressed, double width);
  void give_before(std::int64_t cell, const TakeCell& take);
  Sum& at(std::int64_t cell) { return ring_[static_cast<std::size_t>(cell + reach_cells_) % ring_.size()]; }

  double height_, cell_, reach_;
  std::int64_t reach_cells_, first_;  // the first cell that was not given
  bool begun_ = false;                // empty cells before the line are not given
  Buffer<Sum> ring_;
  std::int64_t last_;  // the last cell that holds anything
};

}  // namespace lamina::bead
