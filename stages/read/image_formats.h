// stages/read/image_formats.h: the readers of layer images, one a format; what the formats hold is told in stages/write/.
#pragma once

#include <cstdint>
#include <string>

#include "stages/read/image.h"

namespace lamina::read {

/// Each reads `file`, open for reading and at its start, which stays the caller's; `bytes` is its size, `path` for messages.
/// errors  of image()
Result<Image> tiff(int file, std::uint64_t bytes, const std::string& path);
Result<Image> png(int file, std::uint64_t bytes, const std::string& path);
Result<Image> pbm(int file, std::uint64_t bytes, const std::string& path);

}  // namespace lamina::read
