// stages/geometry/blocks/block_order.h: the order of triangles within a block.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/mesh.h"

namespace lamina {

/// Triangles that are ordered and stored together: neighbours of a file's order, 144 KiB, which fits a core's cache.
inline constexpr std::uint32_t kBlockSize = 4096;

/// Orders at most kBlockSize triangles by height, and among equals by place: order[i] is the i-th of them.
///
/// Clusters of neighbours in this order are low: a plane meets few of them, and many facets in each. Most exporters write
/// neighbours near each other; in a file in disorder clusters are wide, but as low as in others. The order has no influence
/// on any image. cost: O(T), two passes of a radix sort
void order_block(std::span<const Triangle> block, std::span<std::uint16_t> order);

}  // namespace lamina
