// stages/coverage/band/kernels.h: adds trapezoids to cells of eight rows, and converts cells into changes of level of each row.
//
// Eight rows of a trapezoid are cut out at once, and each column gets what it adds to the eight. All instruction sets do the
// same with the same numbers in the same order.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "stages/coverage/band/exact.h"
#include "stages/coverage/slab_facet.h"
#include "stages/data/choices.h"

namespace lamina::coverage {

// --- what trapezoids add to the columns of a band of rows, and which columns they reach.

inline constexpr std::uint32_t kBandRows = 8;
/// Kernels work on so many rows at once.
inline constexpr std::uint32_t kLanes = 8;

/// Columns as bits, with a bit for each word that holds any.
struct ColumnMarks {
  std::uint64_t *word, *group;
  std::uint32_t words;

  /// Bits of the columns from `first` to `last`, in a word that has one of them.
  static std::uint64_t bits(std::uint32_t w, std::uint32_t first, std::uint32_t last) {
    const std::uint64_t all = ~std::uint64_t{0}, from = w == first / 64 ? all << first % 64 : all;
    return w == last / 64 ? from & all >> (63 - last % 64) : from;
  }
  void mark(std::uint32_t first, std::uint32_t last) const {
    for (std::uint32_t w = first / 64; w <= last / 64; ++w) {
      group[w / 64] |= std::uint64_t{1} << w % 64;
      word[w] |= bits(w, first, last);
    }
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
  bool has(std::uint32_t column) const { return (word[column / 64] >> column % 64 & 1) != 0; }
  void clear() const {
    for (std::uint32_t g = 0; g * 64 < words; ++g) {
      for (; group[g] != 0; group[g] &= group[g] - 1) word[g * 64 + static_cast<std::uint32_t>(std::countr_zero(group[g]))] = 0;
    }
  }
};

/// Columns of eight rows, all empty but while they are made. 64 bytes a column, of which those are touched that facets reach;
/// numbers of the rows are next to each other, a lane each.
class BandCells {
 public:
  void start(std::uint32_t columns) {
    if (columns_ == columns) return;
    size(columns);
    value_.assign(values_ + kLanes, 0.0);
    word_.assign(std::size_t{kMarks} * words_, 0);
    group_.assign(std::size_t{kMarks} * groups_, 0);
    const std::size_t beyond = reinterpret_cast<std::uintptr_t>(value_.data()) / sizeof(double) % kLanes;
    first_ = value_.data() + (kLanes - beyond) % kLanes;
  }
  /// nm^2 by which the mean section of the solid in the column, across x, is larger than in the one before it.
  double* column(std::uint32_t column) { return first_ + std::size_t{column} * kLanes; }
  /// Columns that hold facets, in any row; those that have numbers; those with facets that meet others.
  ColumnMarks held() { return marks(0); }
  ColumnMarks summed() { return marks(1); }
  ColumnMarks suspect() { return marks(2); }
  /// Rows of a column, a bit each, that facets reach which are not horizontal; after mark_sloped() for each of them.
  std::uint32_t sloped_rows(std::uint32_t column) const {
    const std::uint64_t* words = &sloped_[std::size_t{column} / 64 * kLanes];
    std::uint32_t rows = 0;
    for (std::uint32_t lane = 0; lane < kLanes; ++lane)
      rows |= static_cast<std::uint32_t>(words[lane] >> column % 64 & 1) << lane;
    return rows;
  }
  void clear_sloped() { sloped_.assign(std::size_t{words_} * kLanes, 0); }
  void mark_sloped(std::uint32_t lane, std::uint32_t first, std::uint32_t last) {
    for (std::uint32_t w = first / 64; w <= last / 64; ++w)
      sloped_[std::size_t{w} * kLanes + lane] |= ColumnMarks::bits(w, first, last);
  }
  static std::uint64_t bytes_of(std::uint32_t columns) {
    BandCells cells;
    cells.size(columns);
    return (cells.values_ + kLanes) * sizeof(double) +
           (kMarks * (cells.words_ + cells.groups_) + kLanes * cells.words_) * sizeof(std::uint64_t);
  }
  std::uint64_t bytes() const { return bytes_held(value_) + bytes_held(word_) + bytes_held(group_) + bytes_held(sloped_); }

 private:
  static constexpr std::uint32_t kMarks = 3;
  ColumnMarks marks(std::uint32_t kind) {
    return {word_.data() + std::size_t{kind} * words_, group_.data() + std::size_t{kind} * groups_, words_};
  }
  void size(std::uint32_t columns) {
    columns_ = columns;
    values_ = (std::size_t{columns} + 2) * kLanes;
    words_ = columns / 64 + 2;
    groups_ = words_ / 64 + 1;
  }

  std::uint32_t columns_ = 0, words_ = 0, groups_ = 0;
  std::size_t values_ = 0;
  double* first_ = nullptr;
  Buffer<double> value_;
  Buffer<std::uint64_t> word_, group_;
  Buffer<std::uint64_t> sloped_;  // bits of 64 columns of each row
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

/// Columns that hold facets in some row, one next to the other.
struct ColumnSpan {
  std::uint32_t first = 0, end = 0;
  std::array<std::int32_t, kLanes> winding{};  // before it
};

/// Columns of one share in each row, some of which doubles do not decide, or whose samples have to be read: a bit each.
struct OpenColumns {
  std::uint32_t first, end;
  std::uint32_t span;               // its index
  std::uint8_t undecided, outside;  // a share that is neither 0 nor 1 nor between them is outside
  bool suspect;                     // a row may hold facets that meet others
  std::array<double, kLanes> share;
};

/// Columns from `first` on whose levels are known; columns behind them are of the last one's, up to the next.
struct LevelSegment {
  std::uint32_t first, end;
};

/// What a sweep finds; keeps its buffers.
struct SweptBand {
  Buffer<std::uint64_t> level;  // of each column of a segment: a byte a row
  Buffer<LevelSegment> segment;
  Buffer<ColumnSpan> span;
  Buffer<OpenColumns> open;
  bool winds = false;             // a winding number is neither 0 nor 1
  std::uint64_t face_voxels = 0;  // that BandTask::faces decided; an interval of one share counts once
  void start(std::uint32_t columns) {
    level.resize(std::size_t{columns} + 1 + kLanes);
    segment.clear(), span.clear(), open.clear();
    winds = false, face_voxels = 0;
  }
  std::uint64_t bytes() const { return bytes_held(level) + bytes_held(segment) + bytes_held(span) + bytes_held(open); }
};

/// Rows whose cells are complete. They are empty again once they are swept.
struct BandTask {
  std::uint32_t columns, rows;
  FillRule fill;
  alignas(64) std::array<double, kLanes> area, per_area;  // nm^2 of each row's section; 1 / that, 0 of rows beyond the bed
  alignas(64) std::array<double, kLanes> off;             // bound of errors of levels
  double top;                                             // the highest level
  BandCells* cells;
  /// Of the horizontal facets, where they are at one height and doubles may not decide one of the shares; cells have
  /// sloped_rows().
  bool has_ties = false;
  PlaneLevels faces{};
  alignas(64) std::array<double, kLanes> face_off{};  // bound of errors of shares
};

/// Where the level of each row changes, and what it is from there on; before the first it is 0. Capacity for one more than
/// columns, and kLanes.
struct Changes {
  std::uint32_t* column;
  std::uint8_t* level;
  std::uint32_t count = 0;
};

struct BandKernels {
  using Deposit = void(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells, ColumnReach& reach,
                       BandSums& sums);
  using Sweep = void(const BandTask& band, SweptBand& swept);
  using Split = void(const SweptBand& swept, Changes* rows);
  Deposit* deposit;
  Sweep* sweep;
  Split* split;  // levels of columns become changes of each row
};

/// isa  one that this processor has (geometry/isa.h), not kAuto
const BandKernels& band_kernels_for(Isa isa);

}  // namespace lamina::coverage
