// stages/coverage/band/resolver.h: levels of voxels that doubles do not decide, and of those that facets share which meet
// others.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/band/kernels.h"
#include "stages/coverage/samples.h"
#include "stages/coverage/slab_facet.h"
#include "stages/coverage/voxel.h"
#include "stages/data/buffer.h"

namespace lamina::coverage {

struct CoverageReport;

/// What all rows of a layer share; outlives the layer.
struct BandSlab {
  const PixelAxis &columns, &rows;
  const Edges& edges;  // of columns
  Rule rule;
  VoxelSides sides;
  std::int64_t bottom, top;  // nm
  std::span<const SlabFacet> facets;
};

/// Bound of errors of shares in a stretch of columns (docs/coverage.md).
/// depth   of the row, nm
/// scale   sum over facets of the longer of a facet's size and the widest side of a voxel, nm
/// added   numbers that are added up; most  what their sum is below, in sections of the row
double spoilt_share(const BandSlab& slab, double depth, double scale, double added, double maximum);

double widest_side(const BandSlab& slab, double depth);

/// One row after the other; keeps its buffers.
class RowResolver final : public LaneResolver {
 public:
  struct BandPieces {
    std::span<const Trapezoid> piece;
    std::span<const ColumnReach> reach;
  };
  /// pieces  of the band whose first row is `first`; all outlive the row
  void start(const BandSlab& slab, BandPieces pieces, std::uint32_t row, std::uint32_t first, CoverageReport& report);
  std::uint64_t decide(const OpenLanes& open_lanes, std::uint64_t levels) override;
  std::uint32_t even_until() const override { return even_end_; }
  void free(std::int64_t winding, std::uint32_t begin, std::uint32_t end) override;
  std::uint64_t bytes() const { return bytes_held(facet_) + samples_.bytes(); }

 private:
  void list_facets();
  void take(const ColumnSpan& span);
  bool resolve_lane(const OpenLanes& open_lanes, std::uint32_t lane, std::uint8_t& level);
  std::uint8_t exact(const OpenLanes& open_lanes, std::uint32_t lane);

  const BandSlab* slab_ = nullptr;
  CoverageReport* report_ = nullptr;
  BandPieces pieces_;
  std::uint32_t row_ = 0, first_row_ = 0;
  Strip strip_{};
  bool is_listed_ = false;
  Buffer<RowFacet> facet_;           // of the row, by the first column that they reach
  std::span<const RowFacet> taken_;  // of the stretch
  std::uint32_t taken_first_ = 0;    // where it begins
  double spoilt_ = 0;
  std::uint32_t even_begin_ = 0, even_end_ = 0;  // columns of one share
  std::uint8_t even_level_ = 0;
  Samples samples_;
};

}  // namespace lamina::coverage
