#include <fmt/format.h>
#include <png.h>
#include <zlib.h>

#include <algorithm>
#include <csetjmp>
#include <cstring>
#include <string>

#include "stages/geometry/bits.h"
#include "stages/write/png/png_format.h"

namespace lamina::write::png {
namespace {

// Measured on rows of bits of parts (README.md): run lengths alone, without a search for older matches, at the
// fastest level.
constexpr int kLevel = 1;
constexpr int kStrategy = Z_RLE;

/// What libpng's callbacks see. Plain data, as libpng leaves by longjmp.
struct Sink {
  Bytes* file;
  char message[128];
};

void keep_error(png_structp png, png_const_charp text) {
  auto* sink = static_cast<Sink*>(png_get_error_ptr(png));
  std::strncpy(sink->message, text, sizeof sink->message - 1);
  png_longjmp(png, 1);
}

void ignore_warning(png_structp, png_const_charp) {}

void append(png_structp png, png_bytep data, png_size_t length) {
  Bytes& file = *static_cast<Sink*>(png_get_io_ptr(png))->file;
  const auto* from = reinterpret_cast<const std::byte*>(data);
  bool grown = true;
  try {
    file.insert(file.end(), from, from + length);
  } catch (...) {
    grown = false;  // leave the handler before libpng jumps
  }
  if (!grown) png_error(png, "out of memory");
}

void flush_nothing(png_structp) {}

/// Pixels a metre, as pHYs has them, rounded to the nearest.
std::uint32_t per_metre(double dpi) { return static_cast<std::uint32_t>((dpi * 10'000 + 127) / 254); }

/// No object of this frame needs its destructor run when libpng jumps out.
bool write_image(png_structp png, png_infop info, const RunsView& runs, std::uint32_t per_metre_x, std::uint32_t per_metre_y,
                 std::byte* row, std::size_t stride) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, kMostPixelsASide, kMostPixelsASide);
  png_set_IHDR(png, info, runs.columns, runs.rows(), 1, PNG_COLOR_TYPE_PALETTE, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  const png_color palette[2] = {{255, 255, 255}, {0, 0, 0}};
  png_set_PLTE(png, info, palette, 2);
  png_set_pHYs(png, info, per_metre_x, per_metre_y, PNG_RESOLUTION_METER);
  png_set_compression_level(png, kLevel);
  png_set_compression_strategy(png, kStrategy);
  png_set_compression_buffer_size(png, 64 * 1024);
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_NONE);
  png_write_info(png, info);
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    expand_row(runs.row(r), {row, stride});
    png_write_row(png, reinterpret_cast<png_bytep>(row));
  }
  png_write_end(png, info);
  return true;
}

class PngEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    const auto failure = [&](std::string_view why) {
      return Error{Fault::kOutput,
                   fmt::format("PNG cannot hold a layer of {} x {} pixels: {}", runs.columns, runs.rows(), why)};
    };
    if (runs.columns == 0 || runs.rows() == 0) return failure("it has no pixels");
    if (runs.columns > kMostPixelsASide || runs.rows() > kMostPixelsASide) {
      return failure(fmt::format("a side has at most {} pixels", kMostPixelsASide));
    }
    file.clear();
    row_.resize(row_bytes(runs.columns));
    Sink sink{&file, {}};
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &sink, keep_error, ignore_warning);
    png_infop info = png != nullptr ? png_create_info_struct(png) : nullptr;
    bool written = false;
    if (info != nullptr) {
      png_set_write_fn(png, &sink, append, flush_nothing);
      written = write_image(png, info, runs, per_metre(dpi_x), per_metre(dpi_y), row_.data(), row_.size());
    }
    png_destroy_write_struct(&png, &info);
    if (!written) return failure(sink.message[0] != 0 ? sink.message : "out of memory");
    return {};
  }

 private:
  Bytes row_;
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<PngEncoder>(); }

}  // namespace lamina::write::png
