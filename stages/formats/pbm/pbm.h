// stages/formats/pbm/pbm.h: portable bitmaps, binary (P4). Format and sources: README.md in this folder.
#pragma once

#include <memory>

#include "stages/formats/image_format.h"

namespace lamina::formats::pbm {

std::unique_ptr<ImageEncoder> make_encoder();

}  // namespace lamina::formats::pbm
