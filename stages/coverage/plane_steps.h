// stages/coverage/plane_steps.h: where the level of voxels changes that one facet alone crosses.
//
// A voxel that holds one facet and no border of it is cut by a plane. Its share is the chance that three independent
// uniform numbers, as wide as the voxel and as what the plane rises along x over its depth and height, add up to at most the
// distance of the plane from the middle of the voxel: P. Hall's law (Biometrika 1927). So levels change at fixed distances from
// the plane, which a row finds without a look at the columns between.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/slab_facet.h"

namespace lamina::cover {

/// Distances are stored for at most so many steps.
inline constexpr std::uint32_t kMostSteps = 15;

/// nm; a voxel's nominal sides, which true ones differ from by less than 1.
struct VoxelSides {
  double x, y, z;
};

/// The plane of a facet, seen in rows.
struct PlaneSteps {
  double x;       // of the plane at y = 0 from the facet's lowest corner and in the middle of the layer
  double per_y;   // what x gains along y
  double room;    // nm, by which a step may be off
  bool is_known;  // false: nobody can tell steps of this facet

  /// step  the distances, one each of the steps, in order: step k is where the share passes (2 k + 1) / (2 steps)
  /// bottom, sides.z  the layer; widest_room  a larger room makes the steps unknown
  void find(const SlabFacet& facet, double bottom, const VoxelSides& sides, double widest_room, std::span<double> step);
};

}  // namespace lamina::cover
