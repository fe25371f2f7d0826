// stages/coverage/exact_level.h: the level of a voxel in rationals, where doubles do not decide.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/slab_facet.h"
#include "stages/coverage/voxel.h"

namespace lamina::coverage {

/// floor(share n + 1/2) within 0 .. n of a voxel of a stretch of columns with facets; before it the winding number is
/// `winding`. stretch  facets of it; those that begin at or before the column count cost     some ten microseconds a facet
std::uint32_t exact_level(const Voxel& voxel, std::int64_t winding, std::span<const SlabFacet> facets,
                          std::span<const RowFacet> span, std::uint32_t column, std::uint32_t top_level);

}  // namespace lamina::coverage
