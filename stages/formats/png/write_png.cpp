#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <string_view>

#include "stages/formats/png/chunk.h"
#include "stages/formats/png/image_data.h"
#include "stages/formats/png/png_format.h"
#include "stages/geometry/bits.h"

namespace lamina::write::png {
namespace {

constexpr std::size_t kHeadBytes = 128;  // of what stands before the image data, and of IEND, at most

std::byte* put_byte(std::byte* at, unsigned byte) {
  *at = static_cast<std::byte>(byte);
  return at + 1;
}

std::byte* put_text(std::byte* at, std::string_view bytes) {
  std::memcpy(at, bytes.data(), bytes.size());
  return at + bytes.size();
}

/// Pixels a metre, as pHYs has them, rounded to the nearest.
std::uint32_t per_metre(double dpi) { return static_cast<std::uint32_t>((dpi * 10'000 + 127) / 254); }

/// Signature, IHDR, PLTE, pHYs. returns  where the image data begin
std::byte* put_first_chunks(std::byte* at, const RunsView& runs, double dpi_x, double dpi_y) {
  using namespace std::string_view_literals;
  std::byte* chunk = put_text(at, "\x89PNG\r\n\x1A\n");
  at = put_number(chunk + kChunkHead, runs.columns);
  at = put_number(at, runs.rows());
  chunk = close_chunk(chunk, put_text(at, "\x01\x03\0\0\0"sv), "IHDR");  // 1 bit, palette, deflate, filters, not interlaced
  at = put_text(chunk + kChunkHead, "\xFF\xFF\xFF\0\0\0"sv);
  chunk = close_chunk(chunk, at, "PLTE");
  at = put_number(chunk + kChunkHead, per_metre(dpi_x));
  at = put_number(at, per_metre(dpi_y));
  return close_chunk(chunk, put_byte(at, 1), "pHYs");
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
    file.resize(std::max(file.capacity(), kHeadBytes));
    const std::byte* data = put_first_chunks(file.data(), runs, dpi_x, dpi_y);
    const std::size_t end = put_image_data(runs, file, static_cast<std::size_t>(data - file.data()));
    file.resize(end + kChunkHead + kChunkTail);
    close_chunk(file.data() + end, file.data() + end + kChunkHead, "IEND");
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<PngEncoder>(); }

}  // namespace lamina::write::png
