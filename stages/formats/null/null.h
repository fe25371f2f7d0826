// stages/formats/null/null.h: no file at all, for timing what comes before it.
#pragma once

#include <memory>

#include "stages/formats/image_format.h"

namespace lamina::formats::null {

std::unique_ptr<ImageEncoder> make_encoder();

}  // namespace lamina::formats::null
