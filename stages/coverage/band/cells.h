// stages/coverage/band/cells.h: what trapezoids add to the columns of a band of rows, and which columns they reach.
#pragma once

#include <bit>
#include <cstdint>

#include "stages/data/buffer.h"

namespace lamina::coverage {

inline constexpr std::uint32_t kBandRows = 8;
/// Kernels work on so many columns, or rows, at once, and may read that far beyond the last column.
inline constexpr std::uint32_t kLanes = 8;

/// Columns as bits, with a bit for each word that holds any.
struct ColumnMarks {
  std::uint64_t *word, *group;
  std::uint32_t words;

  void mark(std::uint32_t first, std::uint32_t last) const {
    const std::uint64_t from = ~std::uint64_t{0} << first % 64, to = ~std::uint64_t{0} >> (63 - last % 64);
    std::uint32_t w = first / 64;
    const std::uint32_t end = last / 64;
    group[w / 64] |= std::uint64_t{1} << w % 64;
    if (w == end) {
      word[w] |= from & to;
      return;
    }
    word[w] |= from;
    for (++w; w < end; ++w) {
      word[w] = ~std::uint64_t{0};
      group[w / 64] |= std::uint64_t{1} << w % 64;
    }
    word[end] |= to;
    group[end / 64] |= std::uint64_t{1} << end % 64;
  }
  static constexpr std::uint32_t kNone = UINT32_MAX;
  /// The first marked column at or behind `column`, or kNone.
  std::uint32_t next(std::uint32_t column) const {
    std::uint32_t w = column / 64;
    if (w >= words) return kNone;
    const std::uint64_t rest = word[w] & ~std::uint64_t{0} << column % 64;
    if (rest != 0) return w * 64 + static_cast<std::uint32_t>(std::countr_zero(rest));
    ++w;
    for (std::uint32_t g = w / 64; g * 64 < words; ++g) {
      const std::uint64_t some = g == w / 64 ? group[g] & ~std::uint64_t{0} << w % 64 : group[g];
      if (some == 0) continue;
      const std::uint32_t found = g * 64 + static_cast<std::uint32_t>(std::countr_zero(some));
      return found * 64 + static_cast<std::uint32_t>(std::countr_zero(word[found]));
    }
    return kNone;
  }
  /// The first column behind a marked one that is not; there is one word more than columns fill.
  std::uint32_t end_of(std::uint32_t column) const {
    std::uint32_t w = column / 64;
    std::uint64_t gap = ~word[w] & ~std::uint64_t{0} << column % 64;
    while (gap == 0) gap = ~word[++w];
    return w * 64 + static_cast<std::uint32_t>(std::countr_zero(gap));
  }
  /// Eight columns from `column` on.
  std::uint32_t eight(std::uint32_t column) const {
    const std::uint32_t w = column / 64, by = column % 64;
    const std::uint64_t low = word[w] >> by, high = by == 0 ? 0 : word[w + 1] << (64 - by);
    return static_cast<std::uint32_t>((low | high) & 255);
  }
  void clear() const {
    for (std::uint32_t g = 0; g * 64 < words; ++g) {
      for (; group[g] != 0; group[g] &= group[g] - 1) word[g * 64 + static_cast<std::uint32_t>(std::countr_zero(group[g]))] = 0;
    }
  }
};

/// Eight rows, all empty but while they are made. 16 bytes a column and row, of which those are touched that facets reach.
class BandCells {
 public:
  void start(std::uint32_t columns) {
    if (columns_ == columns) return;
    size(columns);
    value_.assign(std::size_t{2} * kBandRows * stride_, 0.0);
    word_.assign(std::size_t{2} * kBandRows * words_, 0);
    group_.assign(std::size_t{2} * kBandRows * groups_, 0);
  }
  /// nm^3 that facets add within a column.
  double* partial(std::uint32_t lane) { return value_.data() + std::size_t{lane} * stride_; }
  /// nm^2 of facets that end before a column: they add this times the width to it and all behind.
  double* passed(std::uint32_t lane) { return partial(kBandRows + lane); }
  ColumnMarks held(std::uint32_t lane) {
    return {word_.data() + std::size_t{lane} * words_, group_.data() + std::size_t{lane} * groups_, words_};
  }
  ColumnMarks suspect(std::uint32_t lane) { return held(kBandRows + lane); }
  static std::uint64_t bytes_of(std::uint32_t columns) {
    BandCells cells;
    cells.size(columns);
    return std::uint64_t{2} * kBandRows *
           (cells.stride_ * sizeof(double) + (cells.words_ + cells.groups_) * sizeof(std::uint64_t));
  }
  std::uint64_t bytes() const { return bytes_held(value_) + bytes_held(word_) + bytes_held(group_); }

 private:
  void size(std::uint32_t columns) {
    columns_ = columns;
    stride_ = (columns + 2 * kLanes) / kLanes * kLanes;
    words_ = columns / 64 + 2;
    groups_ = words_ / 64 + 1;
  }

  std::uint32_t columns_ = 0, stride_ = 0, words_ = 0, groups_ = 0;
  Buffer<double> value_;
  Buffer<std::uint64_t> word_, group_;
};

}  // namespace lamina::coverage
