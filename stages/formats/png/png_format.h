// stages/formats/png/png_format.h: PNG of 1 bit, of 8 bits of grey and of up to 256 colours. Chunks and their
// sources: README.md in this folder.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "stages/formats/image_format.h"

namespace lamina::formats::png {

std::unique_ptr<ImageEncoder> make_encoder();
std::unique_ptr<LevelEncoder> make_8_bit_encoder();

/// A small picture. A byte a pixel, a palette, no filters (PNG specification, second edition, 9.2, 11.2.2 and 11.2.3).
/// columns  at least 1
/// colours  "rrggbb", 1 to 256
/// pixels   numbers of colours, row by row from the top; whole rows, one at least
/// cost     holds the file and all rows
Buffer<std::byte> coloured(std::uint32_t columns, std::span<const std::string> colours, std::span<const std::uint8_t> pixels);

}  // namespace lamina::formats::png
