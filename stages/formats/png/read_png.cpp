#include <fmt/format.h>
#include <png.h>
#include <unistd.h>

#include <cerrno>
#include <csetjmp>
#include <cstring>
#include <new>
#include <optional>

#include "stages/formats/images/image_formats.h"
#include "stages/geometry/bits.h"

namespace lamina::read {
namespace {

// Deflate makes at most 1032 bytes of one (zlib's technical notes); a header that promises more lies.
constexpr std::uint64_t kMostExpansion = 1032;

/// What libpng's callbacks see and what has to outlive a jump out of libpng.
struct Source {
  int file = -1;
  std::uint64_t bytes = 0;
  char message[128] = {};
  std::byte buffer[16 * 1024];
  std::size_t begin = 0, end = 0;  // unread part of buffer
  Buffer<std::byte> row;
  std::optional<RunsBuilder> builder;
  LevelSink* sink = nullptr;
  unsigned level_bits = 0;  // of a value for the sink; 0: the image is of 1 bit
  double dpi_x = 0, dpi_y = 0;
};

void keep_error(png_structp png, png_const_charp text) {
  auto* source = static_cast<Source*>(png_get_error_ptr(png));
  std::strncpy(source->message, text, sizeof source->message - 1);
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void read_bytes(png_structp png, png_bytep to, png_size_t count) {
  Source& source = *static_cast<Source*>(png_get_io_ptr(png));
  while (count != 0) {
    if (source.begin == source.end) {
      ssize_t got;
      do {
        got = ::read(source.file, source.buffer, sizeof source.buffer);
      } while (got < 0 && errno == EINTR);
      if (got <= 0) png_error(png, got == 0 ? "truncated" : "cannot read");
      source.begin = 0;
      source.end = static_cast<std::size_t>(got);
    }
    const std::size_t part = std::min<std::size_t>(count, source.end - source.begin);
    std::memcpy(to, source.buffer + source.begin, part);
    source.begin += part;
    to += part;
    count -= part;
  }
}

/// True if a set bit is a dark pixel.
bool set_is_dark(png_structp png, png_infop info, int colour_type) {
  if (colour_type == PNG_COLOR_TYPE_GRAY) return false;
  png_colorp palette = nullptr;
  int entries = 0;
  png_get_PLTE(png, info, &palette, &entries);
  if (entries < 2) png_error(png, "a palette of fewer than two colours");
  const auto light = [](const png_color& c) { return int{c.red} + c.green + c.blue; };
  return light(palette[1]) < light(palette[0]);
}

bool add_row(Source& source, std::size_t bytes, bool invert) {
  try {
    if (source.level_bits > 0) return source.sink->add_row(source.row, source.sink->levels.columns, source.level_bits, false);
    return source.builder->add_row(std::span(source.row).first(bytes), invert);
  } catch (...) {
    return false;
  }
}

bool prepare(Source& source, std::uint32_t columns, std::size_t stride) {
  try {
    source.row.resize(stride);
    source.builder.emplace(columns);
    if (source.level_bits > 0) source.sink->levels.start(columns);
    return true;
  } catch (...) {
    return false;
  }
}

/// No object of this frame needs its destructor run when libpng jumps out.
bool read_rows(png_structp png, png_infop info, Source& source, int threshold) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, kMostPixelsASide, kMostPixelsASide);
  png_set_chunk_malloc_max(png, 1 << 20);
  png_set_crc_action(png, PNG_CRC_ERROR_QUIT, PNG_CRC_ERROR_QUIT);
  // Comments and colours are passed over: libpng allocates whatever length they claim.
  constexpr png_byte kResolution[] = "pHYs";
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
  png_set_keep_unknown_chunks(png, PNG_HANDLE_CHUNK_AS_DEFAULT, kResolution, 1);
  png_read_info(png, info);
  const std::uint32_t columns = png_get_image_width(png, info), rows = png_get_image_height(png, info);
  const int colour_type = png_get_color_type(png, info);
  const int coded = png_get_bit_depth(png, info);
  const bool exact = source.sink != nullptr && !source.sink->nearest;
  const bool grey = (exact ? coded == 8 : threshold > 0 && coded > 1) && colour_type == PNG_COLOR_TYPE_GRAY;
  const bool levels = source.sink != nullptr && grey;
  if (exact && !grey) png_error(png, "not 8 bits of grey");
  if (grey && coded < 8) png_set_expand_gray_1_2_4_to_8(png);
  if (levels && coded == 16) png_set_swap(png);  // low byte first
  const int depth = grey && coded < 8 ? 8 : coded;
  source.level_bits = levels ? static_cast<unsigned>(depth) : 0;
  if (depth != 1 && !grey) png_error(png, threshold > 0 ? "neither 1-bit nor grey" : "not a 1-bit image");
  if (png_get_interlace_type(png, info) != PNG_INTERLACE_NONE) png_error(png, "interlaced images are not supported");
  const std::size_t step = static_cast<std::size_t>(depth) / 8, stride = grey ? columns * step : row_bytes(columns);
  const std::size_t coded_stride = (std::size_t{columns} * static_cast<std::size_t>(coded) + 7) / 8;
  if ((coded_stride + 1) * std::uint64_t{rows} / kMostExpansion > source.bytes) {
    png_error(png, "more pixels than a file of this size can hold");
  }
  const bool invert = !grey && !set_is_dark(png, info, colour_type);
  png_uint_32 per_unit_x = 0, per_unit_y = 0;
  int unit = 0;
  if (png_get_pHYs(png, info, &per_unit_x, &per_unit_y, &unit) != 0 && unit == PNG_RESOLUTION_METER) {
    source.dpi_x = per_unit_x * 0.0254;
    source.dpi_y = per_unit_y * 0.0254;
  }
  if (!prepare(source, columns, stride)) png_error(png, "out of memory");
  for (std::uint32_t r = 0; r < rows; ++r) {
    png_read_row(png, reinterpret_cast<png_bytep>(source.row.data()), nullptr);
    if (grey && !levels) bits_of_grey(source.row, columns, step, false, threshold);
    if (!add_row(source, row_bytes(columns), invert))
      png_error(png, levels ? "a value is no level" : "too many runs for the memory");
  }
  png_read_end(png, nullptr);
  return true;
}

}  // namespace

Result<Image> png(int file, std::uint64_t bytes, const std::string& path, int threshold, LevelSink* sink) {
  const auto source = std::make_unique<Source>();
  source->file = file;
  source->bytes = bytes;
  source->sink = sink;
  png_structp reader = png_create_read_struct(PNG_LIBPNG_VER_STRING, source.get(), keep_error, ignore_warning);
  png_infop info = reader != nullptr ? png_create_info_struct(reader) : nullptr;
  bool whole = false;
  if (info != nullptr) {
    png_set_read_fn(reader, source.get(), read_bytes);
    whole = read_rows(reader, info, *source, threshold);
  }
  png_destroy_read_struct(&reader, &info, nullptr);
  if (!whole) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole {}PNG: {}; plan the layer again", path,
                                                   threshold > 0 || sink != nullptr ? "" : "1-bit ",
                                                   source->message[0] != 0 ? source->message : "out of memory")};
  }
  return Image{source->builder->finish(), source->dpi_x, source->dpi_y};
}

}  // namespace lamina::read
