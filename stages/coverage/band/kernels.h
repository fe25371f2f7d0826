// stages/coverage/band/kernels.h: adds trapezoids to cells of eight rows, and converts cells of a row into changes of level.
//
// Eight rows of a trapezoid are cut out at once, then eight columns of a row at a time get what it adds. All instruction sets
// do the same with the same numbers in the same order.
#pragma once

#include <array>
#include <cstdint>

#include "stages/coverage/band/cells.h"
#include "stages/coverage/band/trapezoid.h"
#include "stages/data/choices.h"

namespace lamina::coverage {

/// Rows of a band: row `first` + lane lies between y[lane] and y[lane + 1], nm on the bed.
struct BandRows {
  std::uint32_t first = 0, count = 0;
  std::array<double, kBandRows + 1> y;
};

/// Columns that a trapezoid may reach in each row; last included. Of its own rows alone.
struct ColumnReach {
  std::array<std::uint32_t, kBandRows> first, last;
};

/// Sums over the trapezoids of each row, at least, for bounds of errors.
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

/// Decides them.
class LaneResolver {
 public:
  /// levels  eight, a byte each, the first lowest; returned with the requested ones
  virtual std::uint64_t decide(const OpenLanes& open_lanes, std::uint64_t levels) = 0;
  /// Where the level of the last column that decide() decided, which holds no facet with area along x, ends.
  virtual std::uint32_t even_until() const = 0;
  /// Columns [begin, end), which hold no facet, lie at that winding number, neither 0 nor 1.
  virtual void free(std::int64_t winding, std::uint32_t begin, std::uint32_t end) = 0;

 protected:
  ~LaneResolver() = default;
};

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
  LaneResolver* resolver;
};

/// Where the level changes, and what it is from there on; before the first it is 0. Room for one more than columns.
struct Changes {
  std::uint32_t* column;
  std::uint8_t* level;
  std::uint32_t count = 0;
  std::uint64_t held = 0;  // columns
};

struct BandKernels {
  void (*deposit)(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells, ColumnReach& reach,
                  BandSums& sums);
  void (*sweep)(const RowTask& row, Changes& changes);
};

/// isa  one that this processor has (geometry/isa.h), not kAuto
const BandKernels& band_kernels_for(Isa isa);

}  // namespace lamina::coverage
