// stages/read/image_formats.h: the readers of layer images, one a format; what the formats hold is told in stages/write/.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "stages/data/levels.h"
#include "stages/read/image.h"

namespace lamina::read {

/// Takes rows of grey as levels.
struct LevelSink {
  std::uint8_t full;
  Levels& levels;

  /// bits  a value, 4 or 8. returns  false if a value is none of the levels, or there are too many runs
  bool add_row(std::span<const std::byte> row, std::uint32_t columns, unsigned bits, bool bright_is_low);
};

/// threshold  0: 1-bit images alone; else grey ones of 8 and 16 bits too, of which pixels below it are set
/// Each reads `file`, open for reading and at its start, which stays the caller's; `bytes` is its size, `path` for messages.
/// errors  of image()
/// page  the place of the directory; 0: the first one
/// sink  takes levels, of an image that has to have them; its runs are empty then
Result<Image> tiff(int file, std::uint64_t bytes, const std::string& path, int threshold = 0, std::uint64_t page = 0,
                   LevelSink* sink = nullptr);
Result<std::vector<std::uint64_t>> tiff_pages(int file, const std::string& path);
Result<Image> bmp(int file, std::uint64_t bytes, const std::string& path, int threshold = 0);
Result<Image> png(int file, std::uint64_t bytes, const std::string& path, int threshold = 0, LevelSink* sink = nullptr);
Result<Image> pbm(int file, std::uint64_t bytes, const std::string& path, int threshold = 0);

/// Makes bits of a row of grey values, in place: set where a value is below the threshold.
/// step  bytes a pixel; the first one of each counts, or the second where `second`
void bits_of_grey(std::span<std::byte> row, std::uint32_t columns, std::size_t step, bool second, int threshold);

}  // namespace lamina::read
