// stages/data/bit_image.h: a whole 1-bit image as bits, for images whose runs would take more memory.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/data/bit_rows.h"
#include "stages/data/buffer.h"

namespace lamina {

/// A bit a pixel, rows in whole words; BitRows has their order.
class BitImage final : public BitRows {
 public:
  /// No pixel is set.
  BitImage(std::uint32_t columns, std::uint32_t rows)
      : columns_(columns), rows_(rows), bits_(std::size_t{(columns + 63) / 64} * rows, 0) {}

  std::uint32_t columns() const override { return columns_; }
  std::uint32_t rows() const override { return rows_; }
  void row(std::uint32_t number, std::span<std::uint64_t> to) const override { std::ranges::copy(row(number), to.begin()); }

  std::span<const std::uint64_t> row(std::uint32_t number) const {
    return std::span(bits_).subspan(std::size_t{words()} * number, words());
  }
  std::span<std::uint64_t> row(std::uint32_t number) {
    return std::span(bits_).subspan(std::size_t{words()} * number, words());
  }
  std::uint64_t set_pixels() const {
    std::uint64_t set = 0;
    for (const std::uint64_t word : bits_) set += static_cast<std::uint64_t>(std::popcount(word));
    return set;
  }
  std::uint64_t bytes() const { return bytes_held(bits_); }

 private:
  std::uint32_t columns_, rows_;
  Buffer<std::uint64_t> bits_;
};

/// Bytes of such an image.
constexpr std::uint64_t bytes_of_bits(std::uint32_t columns, std::uint32_t rows) {
  return (std::uint64_t{columns} + 63) / 64 * 8 * rows;
}

}  // namespace lamina
