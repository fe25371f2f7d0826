// stages/write/png/png_format.h: 1-bit PNG through libpng. Chunks and their sources: README.md beside this file.
#pragma once

#include <memory>

#include "stages/write/image_format.h"

namespace lamina::write::png {

std::unique_ptr<ImageEncoder> make_encoder();

}  // namespace lamina::write::png
