// stages/formats/images/image_formats.h: the readers of layer images, one a format; stages/formats/ describes the formats.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "stages/support/io/file_reader.h"

namespace lamina::formats {

/// Takes rows of grey as levels.
struct LevelSink {
  std::uint8_t full;
  Levels& levels;
  bool nearest = false;  // values between two levels become the nearest, halves the higher one; else they are wrong
  bool invert = false;   // bright pixels are full

  /// bits  a value, 4, 8 or 16 (low byte first). returns  false if a value is not a level, or there are too many runs
  bool add_row(std::span<const std::byte> row, std::uint32_t columns, unsigned bits, bool bright_is_low);
};

/// Each reads `file`, open for reading and at its start, which stays the caller's; `bytes` is its size, `path` for messages.
/// threshold  0: 1-bit images alone; else grey ones of 4, 8 and 16 bits too, of which pixels below it are set
/// page       the place of the directory; 0: the first one
/// sink       takes the levels of a grey image, whose runs are empty then; one of 1 bit is refused, or with `nearest` leaves
///            the sink as it is
/// errors     of image()
Result<Image> read_tiff(int file, std::uint64_t bytes, const std::string& path, int threshold = 0, std::uint64_t page = 0,
                        LevelSink* sink = nullptr);
Result<std::vector<std::uint64_t>> tiff_pages(int file, const std::string& path);
Result<Image> read_bmp(const FileReader& file, int threshold = 0, LevelSink* sink = nullptr);
Result<Image> read_png(int file, std::uint64_t bytes, const std::string& path, int threshold = 0, LevelSink* sink = nullptr);
Result<Image> read_pbm(const FileReader& file, int threshold = 0, LevelSink* sink = nullptr);

/// Reads rows of an uncompressed image as bytes; false if the file is shorter.
inline bool read_bytes_at(const FileReader& file, std::uint64_t offset, std::span<std::byte> to) {
  return file.read_at(offset, {reinterpret_cast<char*>(to.data()), to.size()});
}

/// Makes bits of a row of grey values, in place: set where a value is below the threshold.
/// step  bytes a pixel; the first one of each counts, or the second where `second`
void bits_of_grey(std::span<std::byte> row, std::uint32_t columns, std::size_t step, bool second, int threshold);
/// The same of values of four bits, of which 15 is 255.
void bits_of_nibbles(std::span<std::byte> row, std::uint32_t columns, int threshold);

}  // namespace lamina::formats
