// stages/coverage/band/exact.h: the level of a voxel that doubles do not decide, from the facets that may meet it.
//
// Facets outside of a voxel change its volume by whole voxels. So the volume is a whole number of voxels more than a sum over
// facets within, and the sum of doubles, which is off by far less than half a voxel, has that number.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>

#include "stages/coverage/slab_facet.h"

namespace lamina::coverage {

/// A box of the second contract (coverage.h), nm.
struct Voxel {
  std::int64_t x0, x1, y0, y1, z0, z1;
};

/// What doubles say of a voxel.
struct NearShare {
  double share, off;  // true one: less than `off` away
  std::uint32_t top_level;
};

/// floor(share n + 1/2) within 0 .. n.
/// near_facets  at least those that meet the voxel
/// cost         some ten nanoseconds a facet where one plane holds all that split the voxel, at an axis or through its centre;
///              else some ten microseconds a facet
std::uint32_t exact_level(const Voxel& voxel, std::span<const SlabFacet* const> near_facets, const NearShare& near_share);

/// The shares that a voxel can have which one plane splits, if any, and their levels.
struct PlaneLevels {
  std::array<double, 4> share;
  std::array<std::uint32_t, 4> level;

  /// The level of a share that is known to `off`, unless two are possible.
  std::optional<std::uint32_t> near(double near_share, double off) const {
    std::optional<std::uint32_t> found;
    for (std::size_t i = 0; i < share.size(); ++i) {
      if (std::abs(share[i] - near_share) > off + 0x1p-50) continue;
      if (found && *found != level[i]) return std::nullopt;
      found = level[i];
    }
    return found;
  }
};

/// Of a horizontal plane at z, between the heights of a voxel.
PlaneLevels levels_of_height(std::int64_t z, std::int64_t z0, std::int64_t z1, std::uint32_t top_level);

}  // namespace lamina::coverage
