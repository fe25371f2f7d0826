// stages/pores/distance.h: how far each voxel of a box is from the solid.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/voxels.h"

namespace lamina::pores {

/// A box of voxels [begin, end) within another.
struct VoxelWindow {
  std::array<std::uint32_t, 3> begin{}, end{};

  std::uint32_t size(int axis) const { return end[static_cast<std::size_t>(axis)] - begin[static_cast<std::size_t>(axis)]; }
};
VoxelWindow whole(const VoxelView& box);

/// Squared distances between the centres of voxels and of the nearest solid ones; x fastest, then y, then z.
struct Distances {
  VoxelWindow window;
  std::array<bool, 3> periodic{};  // axes that the window takes whole keep it
  Nm unit = 1;                     // nm: the shortest edge. Of cubes all distances are whole numbers
  Buffer<float> squared;           // in units; 0 in the solid, infinite if there is none
};

/// Exact, below 4096 voxels of distance. Beyond the window nothing is solid, where it does not repeat.
/// window  within the box
/// source  Felzenszwalb, Huttenlocher, "Distance transforms of sampled functions" (2012)
/// cost    O(voxels of the window), parallel; 4 bytes a voxel
Distances distances(const VoxelView& solid, const VoxelWindow& window);

}  // namespace lamina::pores
