// stages/formats/tiff/tiff.h: TIFF of 1 bit, and of 4 and 8 bits of grey, through libtiff. Tags and their sources: README.md
// in this folder.
#pragma once

#include <memory>

#include "stages/formats/image_format.h"

namespace lamina::formats::tiff {

std::unique_ptr<ImageEncoder> make_g4_encoder();
std::unique_ptr<ImageEncoder> make_deflate_encoder();
std::unique_ptr<ImageEncoder> make_packbits_encoder();
std::unique_ptr<ImageEncoder> make_uncompressed_encoder();
std::unique_ptr<LevelEncoder> make_4_bit_encoder();
std::unique_ptr<LevelEncoder> make_8_bit_encoder();

}  // namespace lamina::formats::tiff
