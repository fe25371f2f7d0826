// stages/coverage/exact_level.h: the level of a voxel in rationals, where doubles do not decide.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/slab_facet.h"
#include "stages/coverage/voxel.h"

namespace lamina::cover {

/// floor(share n + 1/2) within 0 .. n of a voxel with the winding number `winding` before column `first`, where no facet lies.
/// facets  of the row; those that reach columns first .. column count
/// cost    some ten microseconds a facet that reaches the column
std::uint32_t exact_level(const Voxel& voxel, std::int64_t winding, std::span<const SlabFacet> facets,
                          std::span<const std::uint32_t> row, std::uint32_t first, std::uint32_t column,
                          std::uint32_t top_level);

}  // namespace lamina::cover
