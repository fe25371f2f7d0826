// stages/load/diagnosis/spatial_order.h: an order in which facets that lie close together follow each other; internal to load.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::load {

/// The facets of a list by the cells of a grid in which their first corners lie, cells in Morton order, of one cell in the
/// order of the list.
///
/// bounds   of the list; no facet is lost where it is wrong
/// returns  numbers of facets; the same for any number of threads
/// cost     O(T), parallel; 8 bytes a triangle, 4 of them kept, and 2 MiB
Buffer<std::uint32_t> spatial_order(std::span<const Triangle> triangles, const Box& bounds);

}  // namespace lamina::load
