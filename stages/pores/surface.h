// stages/pores/surface.h: the area of the wall between solid and void, from how often straight lines cross it.
#pragma once

#include <array>

#include "stages/data/voxels.h"

namespace lamina::pores {

/// mm2 of wall in a mm3 of the body or box. A wall at the end of the box or body counts only where the box repeats.
struct Surface {
  double crofton;  // twice the mean number of crossings in a mm of line, over 13 directions
  double faces;    // of voxels that lie between solid and void
};

/// Neither is right for all walls:
///            walls square to an axis   45 degrees to two axes   balls
///   crofton  7.3 % too little          6.7 % too little         right, to about 1 % from 10 voxels of radius on
///   faces    exact                     41 % too much            50 % too much
/// solid  cubes or any edges: directions are weighted by their share of the sphere
/// body   pairs of neighbours count where both lie in it; none: the whole box
/// throws  std::length_error  2^32 changes or more
/// source  Legland, Kieu, Devaux, "Computation of Minkowski measures on 2D and 3D binary images" (2007), with its weights for
///         cubes; Ohser, Muecklich, "Statistical Analysis of Microstructures in Materials Science" (2000)
/// cost    O(runs) for each direction, slices in parallel
Surface specific_surface(const VoxelView& solid, const VoxelView* body = nullptr);

/// Shares of the sphere that are nearest to each of the 13 directions; their sum is 1. Those of cubes are published, others are
/// right to 0.5 %. Index as in kDirections.
std::array<double, 13> shares_of_directions(const std::array<Nm, 3>& edge);

/// From a voxel to a neighbour; of two opposite ones one.
inline constexpr std::array<std::array<int, 3>, 13> kDirections{{{1, 0, 0},
                                                                 {0, 1, 0},
                                                                 {0, 0, 1},
                                                                 {1, 1, 0},
                                                                 {-1, 1, 0},
                                                                 {1, 0, 1},
                                                                 {-1, 0, 1},
                                                                 {0, 1, 1},
                                                                 {0, -1, 1},
                                                                 {1, 1, 1},
                                                                 {-1, 1, 1},
                                                                 {1, -1, 1},
                                                                 {-1, -1, 1}}};

}  // namespace lamina::pores
