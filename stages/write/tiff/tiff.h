// stages/write/tiff/tiff.h: 1-bit TIFF through libtiff. Tags and their sources: README.md beside this file.
#pragma once

#include <memory>

#include "stages/write/image_format.h"

namespace lamina::write::tiff {

std::unique_ptr<ImageEncoder> make_g4_encoder();
std::unique_ptr<ImageEncoder> make_packbits_encoder();
std::unique_ptr<ImageEncoder> make_uncompressed_encoder();

}  // namespace lamina::write::tiff
