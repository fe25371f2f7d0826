#include "stages/formats/bmp/write_bmp.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "stages/geometry/bits.h"

namespace lamina::write::bmp {
namespace {

constexpr std::uint32_t kHeadBytes = 62, kInfoBytes = 40;

void put(Bytes& file, std::size_t at, std::uint32_t value, std::size_t bytes = 4) {
  for (std::size_t i = 0; i < bytes; ++i) file[at + i] = static_cast<std::byte>(value >> (8 * i));
}

std::uint32_t per_metre(double dpi) { return static_cast<std::uint32_t>(std::lround(dpi / 0.0254)); }

class BmpEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    if (runs.columns == 0 || runs.rows() == 0 || runs.columns > kMostPixelsASide || runs.rows() > kMostPixelsASide) {
      return Error{Fault::kOutput, fmt::format("bmp holds no {} x {} pixels", runs.columns, runs.rows())};
    }
    const std::size_t used = row_bytes(runs.columns), stride = (used + 3) / 4 * 4;
    const std::uint64_t size = kHeadBytes + std::uint64_t{stride} * runs.rows();
    if (size > UINT32_MAX) {
      return Error{Fault::kOutput, fmt::format("bmp holds less than 4 GiB, {} x {} pixels take {} bytes; choose tiff-g4",
                                               runs.columns, runs.rows(), size)};
    }
    file.resize(size);
    std::fill_n(file.data(), kHeadBytes, std::byte{0});
    std::memcpy(file.data(), "BM", 2);
    put(file, 2, static_cast<std::uint32_t>(size));
    put(file, 10, kHeadBytes);
    put(file, 14, kInfoBytes);
    put(file, 18, runs.columns);
    put(file, 22, runs.rows());
    put(file, 26, 1, 2);
    put(file, 28, 1, 2);
    put(file, 34, static_cast<std::uint32_t>(size - kHeadBytes));
    put(file, 38, per_metre(dpi_x));
    put(file, 42, per_metre(dpi_y));
    put(file, 46, 2);
    put(file, 50, 2);
    put(file, 54, 0x00FFFFFF);
    const std::span<std::byte> rows = std::span(file).subspan(kHeadBytes);
    for (std::uint32_t r = 0; r < runs.rows(); ++r) {
      const std::span<std::byte> row = rows.subspan(stride * (runs.rows() - 1 - r), stride);
      expand_row(runs.row(r), row.first(used));
      std::fill(row.begin() + static_cast<std::ptrdiff_t>(used), row.end(), std::byte{0});
    }
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<BmpEncoder>(); }

}  // namespace lamina::write::bmp
