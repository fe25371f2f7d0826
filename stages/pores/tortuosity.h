// stages/pores/tortuosity.h: how much longer ways through the void are than the box is thick.
#pragma once

#include <cstdint>

#include "stages/data/voxels.h"
#include "stages/pores/distance.h"

namespace lamina::pores {

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
