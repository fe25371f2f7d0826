// stages/formats/png/png_format.h: PNG of 1 bit, and of 8 bits of grey. Chunks and their sources: README.md in this folder.
#pragma once

#include <memory>

#include "stages/formats/image_format.h"

namespace lamina::formats::png {

std::unique_ptr<ImageEncoder> make_encoder();
std::unique_ptr<LevelEncoder> make_8_bit_encoder();

}  // namespace lamina::formats::png
