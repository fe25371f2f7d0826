// stages/slice/plane_index.h: which facets a plane crosses, for planes known beforehand.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/mesh.h"
#include "stages/geometry/interval_table.h"

namespace lamina::slice {

/// The planes [first, last) that each facet crosses, by their numbers; facets between planes are not in it. A corner at a plane
/// is below it.
using PlaneIndex = IntervalTable<std::uint32_t>;

/// triangles  nm, frame of the mesh; fewer than 2^32
/// planes     nm, same frame, strictly increasing
/// cost       O(triangles + planes)
PlaneIndex index_crossings(std::span<const Triangle> triangles, std::span<const std::int64_t> planes);

}  // namespace lamina::slice
