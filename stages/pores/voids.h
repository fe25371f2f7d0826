// stages/pores/voids.h: what a solid leaves empty, as runs.
#pragma once

#include "stages/data/voxels.h"

namespace lamina::pores {

/// The voxels that are not set: of the body, or of the whole box without one.
/// body    of the size of the solid; its edges and periodic axes do not count
/// throws  std::length_error  2^32 changes or more
/// cost    O(runs + rows), parallel over slices
VoxelStack void_of(const VoxelView& solid, const VoxelView* body = nullptr);

/// The voxels that are set in both, or in the first but not in the second.
VoxelStack both_of(const VoxelView& one, const VoxelView& other);
VoxelStack without(const VoxelView& one, const VoxelView& other);

}  // namespace lamina::pores
