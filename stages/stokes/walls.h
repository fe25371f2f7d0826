// stages/stokes/walls.h: which faces of voxels a fluid passes, and how near walls stand, from a finer raster; internal to
// stokes.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/voxels.h"

namespace lamina::stokes {

/// Where a voxel lies, in voxels of the flow.
using CellIndex = std::array<std::uint32_t, 3>;

/// The upper faces of voxels that are `factor` fine ones wide. A face is open if its middle is in the void: neither of the two
/// fine voxels that touch there is solid. Where solid parts the two open faces of a voxel, thinner than it, both are shut.
/// cost  a bit a fine voxel and a byte a voxel
class Walls {
 public:
  /// fine    sides are multiples of factor
  /// factor  odd, so that middles of voxels are middles of fine ones
  Walls(const VoxelView& fine, std::uint32_t factor);

  std::array<std::uint32_t, 3> size() const { return size_; }
  bool open(const CellIndex& at, int axis) const { return (open_[index(at)] >> axis & 1) != 0; }
  /// Whether any of a voxel's six faces is open.
  bool passes(const CellIndex& at) const;
  /// How much more walls hold the velocity through an open face than its neighbours would: the sum of
  /// weight x (1 / distance - 1) of the sides where the next face of its kind is not open.
  double hold(const CellIndex& at, int face, const std::array<double, 3>& weight) const;

 private:
  template <class Visit>
  void for_each_voxel(const Visit& visit) const;
  std::array<std::int64_t, 3> below_face(const CellIndex& at, int face) const;
  bool film_within(const CellIndex& at, int axis, const CellIndex& below) const;
  double distance(const CellIndex& at, int face, int along, bool up) const;
  std::size_t index(const CellIndex& at) const {
    return at[0] + std::size_t{size_[0]} * (at[1] + std::size_t{size_[1]} * at[2]);
  }
  bool solid(std::array<std::int64_t, 3> at) const;
  bool step(CellIndex& at, int axis, bool up) const;
  std::uint32_t voids(std::array<std::int64_t, 3> from, int along, bool up) const;

  std::array<std::uint32_t, 3> size_, fine_;
  std::array<bool, 3> periodic_;
  std::uint32_t factor_;
  std::size_t words_;           // of a fine row
  Buffer<std::uint64_t> bits_;  // of the fine solid
  Buffer<std::uint8_t> open_;   // of each voxel, a bit for each upper face
};

}  // namespace lamina::stokes
