// stages/coverage/band/maker.h: facets of a layer become the levels of eight rows of voxels.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/band/kernels.h"
#include "stages/coverage/band/resolver.h"
#include "stages/data/buffer.h"
#include "stages/data/levels.h"

namespace lamina::coverage {

struct CoverageReport;

/// One band of rows after the other, from the back of the bed; keeps its buffers.
///
/// A facet adds to a column the volume behind it there, and to all columns behind its area along x: their volume is area x
/// width. Where a column contains no facet the winding number is whole, so errors do not outlive an interval of columns with
/// facets, and rationals read no further back.
class BandMaker {
 public:
  /// slab  outlives the layer. isa  one that this processor has, not kAuto
  void start(const BandSlab& slab, Isa isa);
  /// The facet's last row lies in the band that is made next. rows  edges of all
  void enter(const SlabFacet& facet, std::uint32_t index, const Edges& rows);
  bool is_empty() const { return active_.empty(); }
  /// Appends the rows of geometry rows [first, first + rows), the last one first, to `out`; adds to `report`. Its volume_mm3 is
  /// in nm^3, and gets the change of the facets' volume by the rule and samples.
  void make(const BandSlab& slab, std::uint32_t first, std::uint32_t rows, Levels& out, CoverageReport& report);

  std::uint64_t bytes() const {
    return cells_.bytes() + resolver_.bytes() + bytes_held(active_) + bytes_held(reach_) + bytes_held(column_) +
           bytes_held(level_);
  }
  /// At most, for a layer of so many facets on a grid of so many columns.
  static std::uint64_t bytes_of(std::uint64_t facets, std::uint32_t columns);

 private:
  void deposit(const BandSlab& slab, BandSums& sums);
  RowTask task(const BandSlab& slab, std::uint32_t lane, const BandSums& sums);
  void append(const Changes& changes, std::uint32_t columns, Levels& out) const;

  const BandKernels* kernels_ = nullptr;
  BandRows rows_;
  BandCells cells_;
  Buffer<Trapezoid> active_;   // that reach the band, or one below it
  Buffer<ColumnReach> reach_;  // of each active one
  Buffer<std::uint32_t> column_;
  Buffer<std::uint8_t> level_;
  RowResolver resolver_;
};

}  // namespace lamina::coverage
