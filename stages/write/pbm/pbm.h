// stages/write/pbm/pbm.h: portable bitmaps, binary (P4). Format and sources: README.md beside this file.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "stages/write/image_format.h"
#include "stages/write/read_image.h"

namespace lamina::write::pbm {

std::unique_ptr<ImageEncoder> make_encoder();

/// `file`, open for reading, is at its start and stays the caller's; `bytes` is its size.
Result<LayerImage> read(int file, std::uint64_t bytes, const std::string& path);

}  // namespace lamina::write::pbm
