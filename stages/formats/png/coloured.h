// stages/formats/png/coloured.h: small pictures of up to 256 colours as PNG.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "stages/data/buffer.h"

namespace lamina::formats::png {

/// A byte a pixel, a palette, no filters (PNG specification, second edition, 9.2, 11.2.2 and 11.2.3).
/// columns  at least 1
/// colours  "rrggbb", 1 to 256
/// pixels   numbers of colours, row by row from the top; whole rows, one at least
/// cost     holds the file and all rows
Buffer<std::byte> coloured(std::uint32_t columns, std::span<const std::string> colours, std::span<const std::uint8_t> pixels);

}  // namespace lamina::formats::png
