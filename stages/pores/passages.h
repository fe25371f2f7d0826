// stages/pores/passages.h: ways through the void of a box: distances from the solid, the largest ball, tortuosity.
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

struct Tortuosity {
  double mean = 0, minimum = 0, maximum = 0;  // shortest way / thickness, over the void voxels of the far face that are reached
  std::uint64_t reached = 0;                  // of these
  std::uint64_t outlet = 0;                   // void voxels of the far face
};

/// Ways from any void voxel of the lower face of the window along an axis to each of the upper one, from centre to centre, by
/// steps to 26 neighbours of their true length. A step aslant needs a way around its corner through voxels that share faces, so
/// that ways stay in one part (parts.h). All 0 if nothing is reached; 1 in a window of one voxel along the axis.
///
/// Ways along rows, columns and diagonals, also of the box, have their true length; others are too long, by 8 % in a plane and
/// by 13 % in space at most. Fast marching has no such bias in wide pores, but takes a staircase of a voxel's width for its
/// two sides, 41 % too much; pores of plans are a few voxels wide.
/// axis    the window does not repeat along it; along others as the box does
/// throws  std::length_error  a way of more than 2^20 of the shortest edges
/// source  Dijkstra, "A note on two problems in connexion with graphs" (1959), with the buckets of Dial (1969)
/// cost    O(voxels of the window), one thread; 4 bytes a voxel, and 8 for each time that a voxel waits to be left
Tortuosity tortuosity(const VoxelView& solid, const VoxelWindow& window, int axis = 2);

}  // namespace lamina::pores
