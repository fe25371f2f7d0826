// stages/coverage/band/kernels.h: adds trapezoids to cells of eight rows, and converts cells of a row into changes of level.
//
// Eight rows of a trapezoid are cut out at once, then eight columns of a row at a time get what it adds. All instruction sets
// do the same with the same numbers in the same order.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "stages/coverage/slab_facet.h"
#include "stages/data/choices.h"

namespace lamina::coverage {

// --- what trapezoids add to the columns of a band of rows, and which columns they reach.

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

// ---

/// Rows of a band: row `first` + lane lies between y[lane] and y[lane + 1], nm on the bed.
struct BandRows {
  std::uint32_t first = 0, count = 0;
  std::array<double, kBandRows + 1> y;
};

/// Columns that a trapezoid may reach in each row; last included. Of its own rows alone.
struct ColumnReach {
  std::array<std::uint32_t, kBandRows> first, last;
};

/// Sums over the trapezoids of each row, or more, for bounds of errors.
struct BandSums {
  alignas(64) std::array<double, kBandRows> size, columns, count;
};

/// Columns that hold facets, one next to the other.
struct ColumnSpan {
  std::uint32_t first = 0, end = 0;
  std::int64_t winding = 0;  // before it
};

/// Some of eight columns that doubles do not decide, or whose samples have to be read: a bit each.
struct OpenLanes {
  const ColumnSpan& span;
  std::uint32_t column;               // the first of the eight
  std::uint32_t undecided, suspects;  // an undecided one may be suspect
  std::array<double, kLanes> volume;  // nm^3
};

class RowResolver;  // decides them (maker.h)

/// A row whose cells are complete. They are empty again once it is swept, but for marks.
struct RowTask {
  const double* edges;  // of columns, kLanes more than there are
  std::uint32_t columns;
  FillRule fill;
  double area;                       // nm^2 of the row's section
  double widest;                     // nm, of a column; others are 1 nm narrower
  double per_widest, per_narrowest;  // levels for each nm^3 of a voxel
  double top;                        // the highest level
  double spoilt;                     // bound of errors of shares
  double *partial, *passed;
  ColumnMarks held, suspect;
  bool has_suspects;
  RowResolver* resolver;
};

/// Where the level changes, and what it is from there on; before the first it is 0. Capacity for one more than columns.
struct Changes {
  std::uint32_t* column;
  std::uint8_t* level;
  std::uint32_t count = 0;
  std::uint64_t held = 0;  // columns
};

struct BandKernels {
  using Deposit = void(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells, ColumnReach& reach,
                       BandSums& sums);
  using Sweep = void(const RowTask& row, Changes& changes);
  Deposit* deposit;
  Sweep* sweep;
};

/// isa  one that this processor has (geometry/isa.h), not kAuto
const BandKernels& band_kernels_for(Isa isa);

}  // namespace lamina::coverage
