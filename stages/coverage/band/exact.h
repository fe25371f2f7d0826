// stages/coverage/band/exact.h: the level of a voxel that doubles do not decide, from the facets that may meet it.
//
// Facets outside of a voxel change its volume by whole voxels. So the volume is a whole number of voxels more than a sum over
// facets within, and the sum of doubles, which is off by far less than half a voxel, has that number.
#pragma once

#include <array>
#include <bit>
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

  /// The same of eight rows, a byte of `levels` each. rows  a bit each, of those to decide; returns  those that are decided
  std::uint32_t put(const std::array<double, 8>& near_share, const std::array<double, 8>& off, std::uint32_t rows,
                    std::uint64_t& levels) const {
    std::array<std::uint32_t, 4> hit{};
    for (std::size_t i = 0; i < hit.size(); ++i) {
      for (std::uint32_t row = 0; row < 8; ++row)
        hit[i] |= (std::abs(share[i] - near_share[row]) > off[row] + 0x1p-50 ? 0u : 1u) << row;
    }
    std::uint32_t some = 0, several = 0;
    for (std::size_t i = 0; i < hit.size(); ++i) {
      some |= hit[i];
      for (std::size_t k = 0; k < i; ++k) several |= level[i] != level[k] ? hit[i] & hit[k] : 0;
    }
    rows &= some & ~several;
    for (std::size_t i = 0; i < hit.size(); ++i) {
      for (std::uint32_t left = hit[i] & rows; left != 0; left &= left - 1) {
        const int shift = 8 * std::countr_zero(left);
        levels = (levels & ~(std::uint64_t{255} << shift)) | std::uint64_t{level[i]} << shift;
      }
    }
    return rows;
  }
};

/// Of a horizontal plane at z, between the heights of a voxel.
PlaneLevels levels_of_height(std::int64_t z, std::int64_t z0, std::int64_t z1, std::uint32_t top_level);

}  // namespace lamina::coverage
