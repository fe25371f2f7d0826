// stages/formats/images/image_formats.h: the readers of layer images, one a format; stages/formats/ describes the formats.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/bits.h"
#include "stages/support/io/file_reader.h"

namespace lamina::formats {

/// Takes rows of grey as levels.
struct LevelSink {
  std::uint8_t full;
  Levels& levels;
  bool nearest = false;  // values between two levels become the nearest, halves the higher one; else they are wrong
  bool invert = false;   // bright pixels are full
  GreyCounts* counts = nullptr;  // takes what rows have; the levels stay empty then

  /// bits     a value, 4, 8 or 16 (low byte first)
  /// maximum  of the values; 0: that of the bits. returns  false if a value is not a level, or there are too many runs
  bool add_row(std::span<const std::byte> row, std::uint32_t columns, unsigned bits, bool bright_is_low, unsigned maximum = 0);
};

/// Each reads `file`, open for reading and at its start, which stays the caller's; `bytes` is its size, `path` for messages.
/// threshold  0: 1-bit images alone; else grey ones of 2, 4, 8 and 16 bits too, of which pixels below it are set
/// page       the place of the directory; 0: the only one that is no thumbnail
/// keep       of the pixels that are set
/// sink       takes the levels of a grey image, whose runs are empty then; one of 1 bit, black and white, leaves the sink as
///            it is with `nearest`; without, it is refused, except as PNG, which other programs pack into fewer bits
/// errors     of image()
Result<Image> read_tiff(int file, std::uint64_t bytes, const std::string& path, int threshold = 0, std::uint64_t page = 0,
                        LevelSink* sink = nullptr, Keep keep = Keep::kRuns);
Result<std::vector<std::uint64_t>> tiff_pages(int file, const std::string& path);
Result<Image> read_bmp(const FileReader& file, int threshold = 0, LevelSink* sink = nullptr, Keep keep = Keep::kRuns);
Result<Image> read_png(int file, std::uint64_t bytes, const std::string& path, int threshold = 0, LevelSink* sink = nullptr,
                       Keep keep = Keep::kRuns);
Result<Image> read_pbm(const FileReader& file, int threshold = 0, LevelSink* sink = nullptr, Keep keep = Keep::kRuns);
/// Bits a value of a PGM: 16 where its maximum is above 255, else 8.
unsigned pgm_bits(const FileReader& file);

/// The image that a builder collected.
inline Image image_of(RunsBuilder& builder, std::uint32_t columns, double dpi_x, double dpi_y) {
  Image image{builder.finish(), dpi_x, dpi_y, {}, columns, builder.rows()};
  if (auto bits = builder.take_bits()) image.bits = std::make_shared<BitImage>(std::move(*bits));
  image.counts = builder.counts();
  return image;
}

/// Reads rows of an uncompressed image as bytes; false if the file is shorter.
inline bool read_bytes_at(const FileReader& file, std::uint64_t offset, std::span<std::byte> to) {
  return file.read_at(offset, {reinterpret_cast<char*>(to.data()), to.size()});
}

/// Makes bits of a row of grey values, in place: set where a value is below the threshold.
/// step  bytes a pixel; the first one of each counts, or the second where `second`
void bits_of_grey(std::span<std::byte> row, std::uint32_t columns, std::size_t step, bool second, int threshold);
/// The same of values of four bits, of which 15 is 255.
void bits_of_nibbles(std::span<std::byte> row, std::uint32_t columns, int threshold);

/// The brightness of the values of up to 8 bits, 0 (black) to 255: of grey, or of a palette.
struct Colours {
  std::array<std::uint8_t, 256> grey{};
  unsigned count = 0;  // higher values are wrong

  /// Values of grey from 0 to `maximum`, 1 .. 255: floor(255 x value / maximum).
  static Colours of_grey(unsigned maximum);
  /// opaque  0 (transparent: white paper) to 255. cost  none after 256
  void add(unsigned red, unsigned green, unsigned blue, unsigned opaque = 255);
  /// Whether an image of 1 bit is black and white alone.
  bool are_black_and_white() const;
};

/// Of an image whose palette is too short.
inline constexpr std::string_view kNoColour = "a pixel's colour is not in its palette";

/// Replaces values by their brightness, in place, a byte each. returns  false if one of them has no colour
/// bits  a value, 1, 2, 4 or 8, the first one in the highest bits. row  as many bytes as columns, the values first
bool widen_row(std::span<std::byte> row, std::uint32_t columns, unsigned bits, const Colours& colours);
/// Adds a row of 1 bit, which is overwritten; set are the pixels whose brightness is below the threshold, 0: 128.
/// returns  false if a pixel has no colour, or there are too many runs
bool add_bits(std::span<std::byte> row, std::uint32_t columns, const Colours& colours, int threshold, RunsBuilder& builder);

}  // namespace lamina::formats
