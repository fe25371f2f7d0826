// stages/pores/throat.h: the largest ball that passes through the void of a box.
#pragma once

#include <array>

#include "stages/data/voxels.h"
#include "stages/pores/distance.h"

namespace lamina::pores {

/// Diameters in mm of the largest balls that pass from one face of the window to the other along x, y and z; along an axis that
/// repeats, of those that come back to where they began, in another box. 0 if none passes, infinite if nothing is solid.
///
/// Centres of balls step from voxel to neighbour, and a wall lies half of the longest edge before the centre of a solid voxel.
/// So between walls square to an axis an odd number of voxels is measured exactly, an even one a voxel too little, and a round
/// hole within a voxel. Edges that are not the same: to 1/64 of the shortest edge squared.
/// axes    those to compute; the others are 0
/// throws  std::length_error  2^32 changes or more
/// source  Delerue, Perrier, "DXSoil, a library for 3D image analysis in soil science" (2002); here by bisection: voxels that
///         are far enough from the solid are joined as runs, until the next distance does not lead through
/// cost    O(voxels of the window), some ten times, parallel; 4 bytes a voxel, and 12 a run of those that are far enough
std::array<double, 3> throats(const VoxelView& solid, const VoxelWindow& window,
                              std::array<bool, 3> axes = {false, false, true});

}  // namespace lamina::pores
