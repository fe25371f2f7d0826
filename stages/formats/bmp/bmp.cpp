#include "stages/formats/bmp/bmp.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "stages/formats/images/image_formats.h"
#include "stages/formats/row_encoder.h"
#include "stages/geometry/bits.h"

namespace lamina::formats::bmp {
namespace {

constexpr std::uint32_t kHeadBytes = 62, kInfoBytes = 40;

void put(Bytes& file, std::size_t at, std::uint32_t value, std::size_t bytes = 4) {
  for (std::size_t i = 0; i < bytes; ++i) file[at + i] = static_cast<std::byte>(value >> (8 * i));
}

std::uint32_t per_metre(double dpi) { return static_cast<std::uint32_t>(std::lround(dpi / 0.0254)); }

class BmpEncoder : public RowEncoder {
 private:
  Status encode_rows(RowBits image, double dpi_x, double dpi_y, Bytes& file) override {
    if (image.columns == 0 || image.rows == 0 || image.columns > kMaxPixelsASide || image.rows > kMaxPixelsASide) {
      return Error{Fault::kOutput, fmt::format("bmp holds no {} x {} pixels", image.columns, image.rows)};
    }
    const std::size_t used = row_bytes(image.columns), stride = (used + 3) / 4 * 4;
    const std::uint64_t size = kHeadBytes + std::uint64_t{stride} * image.rows;
    if (size > UINT32_MAX) {
      return Error{Fault::kOutput, fmt::format("bmp holds less than 4 GiB, {} x {} pixels take {} bytes; choose tiff-g4",
                                               image.columns, image.rows, size)};
    }
    file.resize(size);
    std::fill_n(file.data(), kHeadBytes, std::byte{0});
    std::memcpy(file.data(), "BM", 2);
    put(file, 2, static_cast<std::uint32_t>(size));
    put(file, 10, kHeadBytes);
    put(file, 14, kInfoBytes);
    put(file, 18, image.columns);
    put(file, 22, image.rows);
    put(file, 26, 1, 2);
    put(file, 28, 1, 2);
    put(file, 34, static_cast<std::uint32_t>(size - kHeadBytes));
    put(file, 38, per_metre(dpi_x));
    put(file, 42, per_metre(dpi_y));
    put(file, 46, 2);
    put(file, 50, 2);
    put(file, 54, 0x00FFFFFF);
    const std::span<std::byte> rows = std::span(file).subspan(kHeadBytes);
    for (std::uint32_t r = 0; r < image.rows; ++r) {
      const std::span<std::byte> row = rows.subspan(stride * (image.rows - 1 - r), stride);
      image.put(r, row.first(used));
      std::fill(row.begin() + static_cast<std::ptrdiff_t>(used), row.end(), std::byte{0});
    }
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<BmpEncoder>(); }

}  // namespace lamina::formats::bmp

namespace lamina::formats {

// Windows bitmaps of 1, 4 and 8 bits, uncompressed. Format: stages/formats/bmp/README.md.

namespace {

std::uint32_t number(std::span<const std::byte> bytes, std::size_t at, std::size_t size = 4) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value |= std::to_integer<std::uint32_t>(bytes[at + i]) << (8 * i);
  return value;
}

}  // namespace

Result<Image> read_bmp(const FileReader& file, int threshold, LevelSink* sink, Keep keep) {
  const auto failure = [&](std::string_view why) {
    return Error{Fault::kVerification, fmt::format("{}: not a whole BMP: {}; plan the layer again", file.path(), why)};
  };
  std::array<std::byte, 54> head{};
  const std::uint64_t bytes = file.size();
  if (bytes < head.size() || !read_bytes_at(file, 0, head)) return failure("truncated");
  const std::uint64_t begin = number(head, 10), info = number(head, 14);
  const auto width = static_cast<std::int32_t>(number(head, 18)), height = static_cast<std::int32_t>(number(head, 22));
  const std::uint32_t bits = number(head, 28, 2), compression = number(head, 30);
  if (info < 40 || info > 1024) return failure("its header is not one");
  if (bits != 1 && (threshold == 0 || (bits != 4 && bits != 8)))
    return failure(threshold > 0 ? "neither of 1 bit nor of 4 or 8 bits" : "not a 1-bit image");
  if (compression != 0) return failure("it is compressed");
  const std::int64_t tall = std::abs(std::int64_t{height});
  if (width <= 0 || tall == 0 || width > std::int64_t{kMaxPixelsASide} || tall > std::int64_t{kMaxPixelsASide})
    return failure(fmt::format("{} x {} pixels", width, tall));
  const auto columns = static_cast<std::uint32_t>(width), rows = static_cast<std::uint32_t>(tall);
  const std::uint32_t named = number(head, 46), count = named == 0 ? 1u << bits : named;
  if (count > 1u << bits) return failure(fmt::format("{} colours", count));
  std::array<std::byte, 1024> palette{};
  if (14 + info + 4 * count > begin || !read_bytes_at(file, 14 + info, std::span(palette).first(4 * std::size_t{count})))
    return failure("its colours are not whole");
  Colours colours;
  for (std::size_t c = 0; c < count; ++c)  // blue, green, red
    colours.add(number(palette, 4 * c + 2, 1), number(palette, 4 * c + 1, 1), number(palette, 4 * c, 1));
  const bool grey = bits > 1 || (sink != nullptr && !colours.are_black_and_white());
  const std::uint64_t stride = (std::uint64_t{columns} * bits + 31) / 32 * 4;
  if (begin > bytes || bytes - begin < stride * rows)
    return failure(fmt::format("{} bytes where {} x {} pixels take {}", bytes, columns, rows, begin + stride * rows));

  if (sink != nullptr && grey) sink->levels.start(columns);
  RunsBuilder builder(columns, rows, keep);
  const auto at_once = static_cast<std::uint32_t>(std::clamp<std::uint64_t>(256 * 1024 / stride, 1, rows));
  Buffer<std::byte> buffer(stride * at_once), wide(grey && bits < 8 ? columns : 0);
  const bool from_top = height < 0;
  for (std::uint32_t first = 0; first < rows; first += at_once) {
    const std::uint32_t rows_read = std::min(at_once, rows - first);
    const std::span<std::byte> strip = std::span(buffer).first(stride * rows_read);
    const std::uint64_t skipped = from_top ? first : rows - first - rows_read;
    if (!read_bytes_at(file, begin + stride * skipped, strip)) return failure("cannot read");
    for (std::uint32_t r = 0; r < rows_read; ++r) {
      std::span<std::byte> row = strip.subspan(stride * (from_top ? r : rows_read - 1 - r), stride);
      if (grey) {
        if (!wide.empty()) {
          std::memcpy(wide.data(), row.data(), std::min<std::size_t>(stride, columns));
          row = wide;
        }
        if (!widen_row(row, columns, bits, colours)) return failure(kNoColour);
        if (sink != nullptr) {
          if (!sink->add_row(row, columns, 8, false)) return failure("too many runs");
          continue;
        }
        bits_of_grey(row, columns, 1, false, threshold);
        if (!builder.add_row(row.first(row_bytes(columns)), false)) return failure("too many runs");
      } else if (!add_bits(row, columns, colours, threshold, builder)) {
        return failure(colours.count < 2 ? kNoColour : "too many runs");
      }
    }
  }
  return image_of(builder, columns, number(head, 38) * 0.0254, number(head, 42) * 0.0254);
}

}  // namespace lamina::formats
