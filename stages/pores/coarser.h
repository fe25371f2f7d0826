// stages/pores/coarser.h: the same box in fewer, larger voxels.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/voxels.h"

namespace lamina::pores {

/// Merges blocks of factor[0] x factor[1] x factor[2] voxels: one is set if more than half of its voxels are. Where it is just
/// half of them, the block is as its first voxel is, the lowest along x, y and z, so that neither side grows.
/// factor  at least 1 each; voxels beyond the last whole block are left out
/// cost    O(runs + rows + voxels of the result), one thread
VoxelStack coarser(const VoxelView& box, const std::array<std::uint32_t, 3>& factor);

}  // namespace lamina::pores
