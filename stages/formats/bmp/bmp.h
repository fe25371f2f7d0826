// stages/formats/bmp/bmp.h: 1-bit Windows bitmaps. Format and sources: README.md in this folder.
#pragma once

#include <memory>

#include "stages/formats/image_format.h"

namespace lamina::formats::bmp {

std::unique_ptr<ImageEncoder> make_encoder();

}  // namespace lamina::formats::bmp
