// stages/geometry/blocks/block_size.h: how many triangles a block has.
#pragma once

#include <cstdint>

namespace lamina {

/// Triangles that are ordered and stored together: neighbours of a file's order, 144 KiB, which fits a core's cache.
inline constexpr std::uint32_t kBlockSize = 4096;

}  // namespace lamina
