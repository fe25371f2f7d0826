// stages/geometry/drop_rows.h: rows of drop images (data/drop_image.h) as words, and counts of their drops.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/bit_rows.h"
#include "stages/data/buffer.h"
#include "stages/data/drop_image.h"
#include "stages/data/runs.h"

namespace lamina {

/// Sets the bits [begin, end) of a row that a pattern of 128 has: bit b of the row is bit b % 64 of `odd` or `even`, by b / 64.
/// stride  from a word of the row to the next one
inline void set_pattern(std::uint64_t* row, std::uint64_t begin, std::uint64_t end, std::uint64_t even, std::uint64_t odd,
                        std::size_t stride = 1) {
  if (begin >= end) return;
  const std::uint64_t first = begin / 64, last = (end - 1) / 64;
  const std::uint64_t head = ~std::uint64_t{0} << (begin % 64), tail = ~std::uint64_t{0} >> (63 - (end - 1) % 64);
  const auto of = [&](std::uint64_t word) { return (word & 1) != 0 ? odd : even; };
  if (first == last) {
    row[first * stride] |= head & tail & of(first);
    return;
  }
  row[first * stride] |= head & of(first);
  for (std::uint64_t word = first + 1; word < last; ++word) row[word * stride] = of(word);
  row[last * stride] |= tail & of(last);
}

/// Makes the table of the pattern's words, unless it is of them: few operations a word then, in place of 64 comparisons.
void tabulate(CorePattern& core);

/// Sets the bits b of [begin, end) with first + b * column_step < threshold, modulo 2^32, where `allowed` has bit b % 64.
void set_core(std::uint64_t* row, std::uint64_t begin, std::uint64_t end, std::uint32_t first, const CorePattern& core,
              std::uint64_t allowed, std::size_t stride = 1);

/// The bits of the 64 pixels from column 64 x word on that get a drop more than the base of their zone.
std::uint64_t extra_bits(const DropPatterns& patterns, const DropZone& zone, std::uint32_t row, std::uint32_t word);

/// The pixels of a drop image that get more than `drop` drops.
class DropPlane final : public BitRows {
 public:
  DropPlane(const DropImageView& image, std::uint32_t drop) : image_(image), drop_(drop) {}
  std::uint32_t columns() const override { return image_.zones.columns; }
  std::uint32_t rows() const override { return image_.zones.rows(); }
  void row(std::uint32_t number, std::span<std::uint64_t> words) const override;
  void set_words(std::uint32_t number, std::span<std::uint64_t> words, Buffer<RowSpan>& spans) const override;
  bool has_spans() const override { return image_.patterns->edges_alone; }
  void spans(std::uint32_t number, WordSpans& spans) const override;

 private:
  void add(const DropZone& zone, std::uint32_t row, std::uint32_t begin, std::uint32_t end, std::uint64_t* words) const;

  DropImageView image_;
  std::uint32_t drop_;
};

/// The same as runs. cost  O(runs), and a few operations a change
void runs_of(const DropImageView& image, std::uint32_t drop, Runs& result);

/// Drops of each pixel as levels. cost  O(pixels that are not whole)
void levels_of(const DropImageView& image, Levels& result);

/// Counts drops without a row of them. Scratch; keeps its capacity.
class DropCounter {
 public:
  /// The patterns must outlive its use.
  void start(const DropPatterns& patterns);
  /// Pixels [begin, end) of a zone in a row that get one drop more than its base. cost  a few operations; of a core O(pixels)
  std::uint64_t extra(std::uint8_t zone, std::uint32_t row, std::uint32_t begin, std::uint32_t end) const;
  /// For between(): the pixels of a tile's row before each column that get one more. nullptr of a core.
  const std::uint8_t* before(std::uint8_t zone, std::uint32_t row) const;
  static std::uint64_t between(const std::uint8_t* before, std::uint32_t begin, std::uint32_t end) {
    const auto up_to = [&](std::uint32_t column) {
      return std::uint64_t{column / kTileSide} * before[kTileSide] + before[column % kTileSide];
    };
    return up_to(end) - up_to(begin);
  }
  std::uint64_t drops(std::uint8_t zone, std::uint32_t row, std::uint32_t begin, std::uint32_t end) const {
    return std::uint64_t{patterns_->zone[zone].base} * (end - begin) + extra(zone, row, begin, end);
  }
  /// Those that get any.
  std::uint64_t pixels(std::uint8_t zone, std::uint32_t row, std::uint32_t begin, std::uint32_t end) const {
    return patterns_->zone[zone].base > 0 ? end - begin : extra(zone, row, begin, end);
  }
  std::uint64_t bytes() const { return bytes_held(before_); }

 private:
  static constexpr std::size_t kRow = kTileSide + 1;
  const DropPatterns* patterns_ = nullptr;
  Buffer<std::uint8_t> before_;  // of each row of each tile: the set pixels before a column
};

/// Totals of an image, by zone.
class DropTotals {
 public:
  /// cost  O(runs); of a core O(pixels)
  DropTotals(const DropImageView& image, const DropCounter& counter);
  std::uint64_t drops() const;
  /// Pixels of more than so many drops.
  std::uint64_t pixels(std::uint32_t drop = 0) const;
  /// The most drops of any pixel.
  std::uint32_t maximum() const;

 private:
  struct ZoneTotal {
    DropZone zone;
    std::uint64_t pixels = 0, extra = 0;
  };
  std::vector<ZoneTotal> zones_;
};

}  // namespace lamina
