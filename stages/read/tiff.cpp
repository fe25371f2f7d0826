#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <string>

#include "stages/data/handles/tiff.h"
#include "stages/geometry/bits.h"
#include "stages/read/g4.h"
#include "stages/read/image_formats.h"

namespace lamina::read {
namespace {

constexpr std::uint32_t kLargestAllocation = 64 << 20;  // bytes; no strip that anybody writes is larger

/// Rows of `stride` bytes that `bytes` of this compression can hold at most; a header that promises more lies.
std::uint64_t most_rows(std::uint16_t compression, std::uint64_t bytes, std::uint64_t stride) {
  switch (compression) {
    case COMPRESSION_NONE: return bytes / stride;
    case COMPRESSION_PACKBITS: return bytes * 64 / stride;  // two bytes make 128
    case COMPRESSION_CCITTFAX4:
    case COMPRESSION_CCITTFAX3:
    case COMPRESSION_CCITTRLE: return bytes * 8;  // a row takes a bit
    default: return bytes * 2048 / stride + 1;    // deflate 1032, LZW about 1400
  }
}

/// Why the strips cannot hold the rows, or nothing if they can.
std::string check_strips(TIFF* tiff, std::uint64_t file_bytes, std::uint16_t compression, std::uint32_t rows,
                         std::uint64_t stride) {
  std::uint32_t rows_per_strip = rows;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows_per_strip);
  rows_per_strip = std::min(rows_per_strip, rows);
  if (rows_per_strip == 0) return "strips of no rows";
  const std::uint32_t strips = TIFFNumberOfStrips(tiff);
  if (strips != (rows + rows_per_strip - 1) / rows_per_strip) return "its number of strips does not fit its rows";
  for (std::uint32_t strip = 0; strip < strips; ++strip) {
    const std::uint64_t offset = TIFFGetStrileOffset(tiff, strip), bytes = TIFFGetStrileByteCount(tiff, strip);
    if (offset < 8 || bytes == 0 || offset > file_bytes || bytes > file_bytes - offset) {
      return fmt::format("strip {} is not within the file", strip);
    }
    const std::uint32_t strip_rows = std::min(rows_per_strip, rows - strip * rows_per_strip);
    if (most_rows(compression, bytes, stride) < strip_rows) return fmt::format("strip {} is too short", strip);
  }
  return {};
}

/// Not mapped: a file that becomes shorter while it is read is an error then, and no signal.
constexpr const char* kMode = "rCm";

/// The image of a file in Group 4, without bits. false: libtiff has to say what is wrong with it, or to read it.
bool read_g4(TIFF* tiff, int file, std::uint32_t columns, std::uint32_t rows, bool white_is_set, Runs& runs) {
  std::uint32_t rows_per_strip = rows;
  std::uint16_t fill_order = FILLORDER_MSB2LSB;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_ROWSPERSTRIP, &rows_per_strip);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_FILLORDER, &fill_order);
  rows_per_strip = std::min(rows_per_strip, rows);
  runs.columns = columns;
  runs.row_offset.assign(1, 0);
  G4Decoder decoder;
  Buffer<std::byte> coded;
  for (std::uint32_t row = 0, strip = 0; row < rows; row += rows_per_strip, ++strip) {
    const std::uint64_t size = TIFFGetStrileByteCount(tiff, strip);
    if (size > kLargestAllocation) return false;
    coded.resize(size);
    const auto place = static_cast<off_t>(TIFFGetStrileOffset(tiff, strip));
    if (::pread(file, coded.data(), coded.size(), place) != static_cast<ssize_t>(coded.size())) return false;
    const G4Strip of_rows{columns, std::min(rows_per_strip, rows - row), fill_order == FILLORDER_LSB2MSB, white_is_set};
    if (!decoder.append(coded, of_rows, runs)) return false;
  }
  return true;
}

/// In dpi; 0 where the file does not say.
void read_resolution(TIFF* tiff, Image& image) {
  std::uint16_t unit = RESUNIT_INCH;
  TIFFGetFieldDefaulted(tiff, TIFFTAG_RESOLUTIONUNIT, &unit);
  float x = 0, y = 0;
  if (TIFFGetField(tiff, TIFFTAG_XRESOLUTION, &x) == 0 || TIFFGetField(tiff, TIFFTAG_YRESOLUTION, &y) == 0) return;
  if (unit == RESUNIT_NONE) return;
  const double to_inch = unit == RESUNIT_CENTIMETER ? 2.54 : 1;
  image.dpi_x = double{x} * to_inch;
  image.dpi_y = double{y} * to_inch;
}

}  // namespace

Result<Image> tiff(int file, std::uint64_t bytes, const std::string& path, int threshold, std::uint64_t page, LevelSink* sink) {
  std::string message;  // of libtiff, outlives the handle
  const auto failure = [&](std::string_view why) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole {}TIFF: {}; plan the layer again", path,
                                                   threshold > 0 || sink != nullptr ? "" : "1-bit ", why)};
  };
  const auto options = strict_tiff_options(message);
  const int own_file = ::dup(file);
  if (options == nullptr || own_file < 0) {
    if (own_file >= 0) ::close(own_file);
    return failure(message.empty() ? "out of memory or files" : message);
  }
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kLargestAllocation);
  const TiffHandle handle(TIFFFdOpenExt(own_file, path.c_str(), kMode, options.get()));
  if (handle == nullptr) {
    ::close(own_file);
    return failure(message.empty() ? "no directory" : message);
  }
  if (page != 0 && TIFFSetSubDirectory(handle.get(), page) == 0) return failure(message.empty() ? "no such page" : message);
  if (!message.empty()) return failure(message);
  std::uint32_t columns = 0, rows = 0;
  std::uint16_t bits = 1, samples = 1, photometric = 0, compression = COMPRESSION_NONE;
  TIFFGetField(handle.get(), TIFFTAG_IMAGEWIDTH, &columns);
  TIFFGetField(handle.get(), TIFFTAG_IMAGELENGTH, &rows);
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_SAMPLESPERPIXEL, &samples);
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_COMPRESSION, &compression);
  const bool grey = threshold > 0 && (bits == 8 || bits == 16);
  if (TIFFGetField(handle.get(), TIFFTAG_PHOTOMETRIC, &photometric) == 0 || photometric > PHOTOMETRIC_MINISBLACK ||
      (sink != nullptr ? bits != 4 && bits != 8 : bits != 1 && !grey) || samples != 1) {
    if (sink != nullptr) return failure("neither 4 nor 8 bits of grey");
    return failure(threshold > 0 ? "neither 1-bit nor grey of 8 or 16 bits" : "not a 1-bit image");
  }
  std::uint16_t kind = SAMPLEFORMAT_UINT;
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_SAMPLEFORMAT, &kind);
  if (grey && kind != SAMPLEFORMAT_UINT) return failure("its values are not whole numbers from 0 on");
  if (threshold > 0 && page == 0 && TIFFLastDirectory(handle.get()) == 0)
    return failure("several images in one file; write one a layer");
  std::uint16_t orientation = ORIENTATION_TOPLEFT;
  TIFFGetFieldDefaulted(handle.get(), TIFFTAG_ORIENTATION, &orientation);
  if (orientation != ORIENTATION_TOPLEFT) {
    return failure(
        fmt::format("its Orientation tag is {}; write rows from the top and columns from the left, tag 1", orientation));
  }
  if (TIFFIsTiled(handle.get()) != 0) return failure("tiles are not supported");
  if (columns == 0 || rows == 0 || columns > kMostPixelsASide || rows > kMostPixelsASide) {
    return failure(fmt::format("{} x {} pixels", columns, rows));
  }
  const std::size_t step = bits / 8u, stride = (std::size_t{columns} * bits + 7) / 8;
  const std::string wrong = check_strips(handle.get(), bytes, compression, rows, stride);
  if (!wrong.empty()) return failure(wrong);
  if (TIFFScanlineSize(handle.get()) != static_cast<tmsize_t>(stride)) return failure("rows of an unexpected length");

  if (sink != nullptr) sink->levels.start(columns);
  Image image;
  read_resolution(handle.get(), image);
  if (sink == nullptr && compression == COMPRESSION_CCITTFAX4 && !grey &&
      read_g4(handle.get(), file, columns, rows, photometric == PHOTOMETRIC_MINISBLACK, image.runs)) {
    return image;
  }
  RunsBuilder builder(columns);
  Buffer<std::byte> row(stride);
  for (std::uint32_t r = 0; r < rows; ++r) {
    if (TIFFReadScanline(handle.get(), row.data(), r, 0) < 0 || !message.empty()) {
      return failure(fmt::format("row {}: {}", r, message.empty() ? "cannot be decoded" : message));
    }
    // Values of two bytes are in the order of this program's hosts, little-endian. Those of min-is-white: bright is small.
    const bool bright_is_low = photometric == PHOTOMETRIC_MINISWHITE;
    if (sink != nullptr) {
      if (!sink->add_row(row, columns, bits, bright_is_low)) return failure(fmt::format("row {}: a value is no level", r));
      continue;
    }
    if (grey) bits_of_grey(row, columns, step, step == 2, bright_is_low ? 256 - threshold : threshold);
    if (!builder.add_row(std::span(row).first(row_bytes(columns)), grey ? bright_is_low : !bright_is_low))
      return failure("too many runs");
  }
  image.runs = builder.finish();
  return image;
}

Result<std::vector<std::uint64_t>> tiff_pages(int file, const std::string& path) {
  constexpr std::size_t kMostPages = 1 << 20;
  std::string message;
  const auto options = strict_tiff_options(message);
  const int own_file = ::dup(file);
  if (options != nullptr) TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(), kLargestAllocation);
  const TiffHandle handle(options != nullptr && own_file >= 0 ? TIFFFdOpenExt(own_file, path.c_str(), kMode, options.get())
                                                              : nullptr);
  if (handle == nullptr) {
    if (own_file >= 0) ::close(own_file);
    return Error{Fault::kInput, fmt::format("{}: not a TIFF: {}; take a whole file", path, message)};
  }
  std::vector<std::uint64_t> pages;
  do {
    std::uint32_t kind = 0;
    TIFFGetField(handle.get(), TIFFTAG_SUBFILETYPE, &kind);
    if ((kind & (FILETYPE_REDUCEDIMAGE | FILETYPE_MASK)) == 0) pages.push_back(TIFFCurrentDirOffset(handle.get()));
  } while (pages.size() <= kMostPages && TIFFReadDirectory(handle.get()) != 0);
  if (!message.empty() || pages.size() > kMostPages) {
    return Error{Fault::kInput, fmt::format("{}: page {}: {}; take a whole file", path, pages.size(),
                                            message.empty() ? "too many of them" : message)};
  }
  return pages;
}

}  // namespace lamina::read
