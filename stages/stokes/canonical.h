// stages/stokes/canonical.h: a box turned into one frame of its own, so that every way it may lie gives the same digits.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/voxels.h"
#include "stages/stokes/cells.h"

namespace lamina::stokes {

/// Axis c of a turned box is axis from[c] of the box, backwards where stated. Mirrors are among the turns.
struct Turn {
  std::array<std::size_t, 3> from{0, 1, 2};
  std::array<bool, 3> backwards{};

  bool operator==(const Turn&) const = default;
  /// Where a voxel of the box lies in the turned box, whose sides are `size`; and back. Voxels of the flow or fine ones.
  CellIndex in_turned(const CellIndex& in_box, const CellIndex& size) const;
  CellIndex in_box(const CellIndex& in_turned, const CellIndex& size) const;
};

/// A box as it is solved: the axis of the force is kAxis, and of the turns and mirrors that leave that the one whose sides,
/// edges and voxels come first in an order that does not depend on how the box was turned.
class Canonical {
 public:
  static constexpr int kAxis = 2;

  /// box         outlives it
  /// reversible  creeping flow, which a mirror along the force only reverses; else that end stays where it is
  /// errors      kInput: 2^32 changes along the rows of the turned box
  /// cost        O(runs + surface voxels); the runs of the turned box, unless it lies that way already
  static Result<Canonical> of(const VoxelView& box, int axis, bool reversible = true);

  VoxelView view() const { return turned_ ? stack_.view() : box_; }
  /// Frees the voxels once their cells are made; view() is empty then.
  void forget_voxels() {
    stack_ = {};
    box_ = {};
  }
  /// The turn that is used, the first of those that give the same voxels.
  const Turn& turn() const { return turns_.front(); }
  /// A mean velocity of the turned box, for the force along the axis of the box. Where several turns give the same voxels it is
  /// their mean: what symmetry forbids is 0.
  std::array<double, 3> in_box(const std::array<double, 3>& velocity) const;

 private:
  VoxelView box_;
  VoxelStack stack_;
  bool turned_ = false;
  std::vector<Turn> turns_;
};

}  // namespace lamina::stokes
