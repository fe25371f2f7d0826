// stages/write/tiff/tiff.h: 1-bit TIFF through libtiff. Tags and their sources: README.md beside this file.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "stages/write/image_format.h"
#include "stages/write/read_image.h"

namespace lamina::write::tiff {

std::unique_ptr<ImageEncoder> make_g4_encoder();
std::unique_ptr<ImageEncoder> make_packbits_encoder();
std::unique_ptr<ImageEncoder> make_uncompressed_encoder();

/// `file`, open for reading, is at its start and stays the caller's; `bytes` is its size.
Result<LayerImage> read(int file, std::uint64_t bytes, const std::string& path);

}  // namespace lamina::write::tiff
