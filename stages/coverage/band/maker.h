// stages/coverage/band/maker.h: facets of a layer become the levels of eight rows of voxels.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/band/exact.h"
#include "stages/coverage/band/kernels.h"
#include "stages/coverage/slab_facet.h"
#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/levels.h"

namespace lamina::coverage {

struct CoverageReport;

/// How shares become levels.
struct Rule {
  FillRule fill;
  std::uint32_t top_level;  // n
};

/// What all rows of a layer share; outlives the layer.
struct BandSlab {
  /// nm; a voxel's nominal sides, which true ones differ from by less than 1.
  struct VoxelSides {
    double x, y, z;
  };
  const PixelAxis &columns, &rows;
  const Edges& edges;  // of columns
  Rule rule;
  VoxelSides sides;
  std::int64_t bottom, top;  // nm
  std::span<const SlabFacet> facets;
};

/// A row of voxels in a layer, nm.
struct Strip {
  std::int64_t y0, y1, z0, z1;
  double area() const { return static_cast<double>(y1 - y0) * static_cast<double>(z1 - z0); }
};

// --- levels of voxels that doubles do not decide, and of those that facets share which meet others.

/// A span in one row.
struct LineSpan {
  std::uint32_t first = 0, end = 0;
  std::int64_t winding = 0;  // before it
};

/// Winding numbers at 8 x 8 x 8 points a voxel, along 64 lines of a row. Counts an interval of columns at once; keeps its
/// buffers.
class Samples {
 public:
  struct SampleCount {
    std::uint16_t solid = 0;   // samples that the fill rule calls solid
    std::uint16_t others = 0;  // samples whose winding number is neither 0 nor 1
  };

  /// taken  facets that reach the columns; none reaches columns outside
  /// cost   64 lines a facet, one step a column and line
  void count(const BandSlab& slab, const Strip& strip, const LineSpan& span, std::span<const RowFacet> taken);

  const SampleCount& at(std::uint32_t column) const { return count_[column - first_]; }
  bool knows(std::uint32_t column) const { return column >= first_ && column < end_; }
  void forget() { first_ = end_ = 0; }
  std::uint64_t bytes() const { return bytes_held(crossing_) + bytes_held(count_); }

 private:
  /// Where a facet crosses a line: at or before that sample, counted from the first column.
  struct Crossing {
    std::uint32_t line;
    std::int32_t sign;
    std::uint64_t sample;
    friend bool operator<(const Crossing& a, const Crossing& b) {
      return a.line != b.line ? a.line < b.line : a.sample < b.sample;
    }
  };
  void cross(const BandSlab& slab, const Strip& strip, const Triangle& facet);

  std::uint32_t first_ = 0, end_ = 0;
  Buffer<Crossing> crossing_;
  Buffer<SampleCount> count_;
};

/// One row after the other; keeps its buffers.
class RowResolver {
 public:
  struct BandPieces {
    std::span<const Trapezoid> piece;
    std::span<const ColumnReach> reach;
  };
  /// pieces  of the band whose first row is `first`; all outlive the row
  void start(const BandSlab& slab, BandPieces pieces, std::uint32_t row, std::uint32_t first, CoverageReport& report);
  /// Puts levels of the row's open columns in their place.
  void decide(SweptBand& swept);
  /// Columns that hold facets.
  std::uint64_t count_held();
  /// Adds what columns between spans, whose winding numbers are neither 0 nor 1, change of the volume.
  void add_free(const SweptBand& swept);
  std::uint64_t bytes() const { return bytes_held(facet_) + bytes_held(near_) + bytes_held(near_facets_) + samples_.bytes(); }

 private:
  void list_facets();
  void take(const ColumnSpan& span, std::uint32_t lane);
  void approach(std::uint32_t column);
  bool count_samples(const OpenColumns& open, double share, std::uint8_t& level);
  std::uint8_t exact(std::uint32_t column, double share);

  const BandSlab* slab_ = nullptr;
  CoverageReport* report_ = nullptr;
  BandPieces pieces_;
  std::uint32_t row_ = 0, first_row_ = 0;
  Strip strip_{};
  Buffer<RowFacet> facet_;           // of the row, by the first column that they reach
  std::span<const RowFacet> taken_;  // of the span at work
  LineSpan span_;
  std::size_t next_ = 0;   // of those: behind all that begin at or before the column at work
  Buffer<RowFacet> near_;  // those that reach it
  Buffer<const SlabFacet*> near_facets_;
  double spoilt_ = 0;
  bool even_ = false;  // facets near have no area along x, and are those of the column that was decided last
  std::uint8_t even_level_ = 0;
  Samples samples_;
};

// ---

/// The height of the horizontal facets of a band, if they have one.
struct BandFaces {
  std::uint32_t heights = 0;  // 0, 1, or more than one
  Nm z = 0;
  void add(Nm at) {
    if (heights == 0) z = at;
    if (heights == 0 || at != z) ++heights;
  }
};

/// One band of rows after the other, from the back of the bed; keeps its buffers.
///
/// A facet adds to a column the volume behind it there, and to all columns behind its area along x: their volume is area x
/// width. Where a column contains no facet the winding number is whole, so errors do not outlive an interval of columns with
/// facets, and rationals read no further back.
class BandMaker {
 public:
  /// A facet's piece in the layer has up to five corners, and one trapezoid less.
  static constexpr std::uint64_t kMaxPieces = 4;
  /// slab  outlives the layer. isa  one that this processor has, not kAuto. counts_held  CoverageScratch::counts_held
  void start(const BandSlab& slab, Isa isa, bool counts_held);
  /// The facet's last row lies in the band that is made next. rows  edges of all; pieces  its trapezoids where they are cut,
  /// of any copy
  void enter(const SlabFacet& facet, std::uint32_t index, const Edges& rows, std::span<const Trapezoid> pieces);
  bool is_empty() const { return active_.empty(); }
  /// Appends the rows of geometry rows [first, first + rows), the last one first, to `out`; adds to `report`. Its volume_mm3 is
  /// in nm^3, and gets the change of the facets' volume by the rule and samples.
  void make(const BandSlab& slab, std::uint32_t first, std::uint32_t rows, Levels& out, CoverageReport& report);

  std::uint64_t bytes() const {
    return cells_.bytes() + swept_.bytes() + resolver_.bytes() + bytes_held(active_) + bytes_held(reach_) +
           bytes_held(column_) + bytes_held(level_);
  }
  /// Bound of bytes(), for a layer of so many facets on a grid of so many columns.
  static std::uint64_t bytes_of(std::uint64_t facets, std::uint32_t columns);

 private:
  void deposit(const BandSlab& slab, BandSums& sums);
  BandTask task(const BandSlab& slab, const BandSums& sums);
  void find_ties(const BandSlab& slab, BandTask& task);
  void resolve(const BandSlab& slab, CoverageReport& report);
  void append(Changes changes, std::uint32_t columns, Levels& out) const;

  const BandKernels* kernels_ = nullptr;
  BandRows rows_;
  bool counts_held_ = false;
  BandFaces faces_;
  BandCells cells_;
  SweptBand swept_;
  Buffer<Trapezoid> active_;      // that reach the band, or one below it
  Buffer<ColumnReach> reach_;     // of each active one
  Buffer<std::uint32_t> column_;  // changes of each row
  Buffer<std::uint8_t> level_;
  RowResolver resolver_;
};

}  // namespace lamina::coverage
