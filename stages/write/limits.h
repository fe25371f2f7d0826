// stages/write/limits.h: how large an image may say that it is.
#pragma once

#include <cstdint>

#include "stages/data/grid.h"

namespace lamina::write {

/// A side of the largest bed at the finest dpi (data/units.h, data/grid.h): no writer makes, and no reader believes,
/// more columns or rows. A row of bits is then at most 268,436 bytes.
inline constexpr std::uint32_t kMostPixelsASide =
    static_cast<std::uint32_t>(ceil_div(kNmReach * std::int64_t{25'400}, kNmPerInch));

}  // namespace lamina::write
