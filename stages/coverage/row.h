// stages/coverage/row.h: facets of a layer become the levels of one row of voxels.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/edges.h"
#include "stages/coverage/row_cells.h"
#include "stages/coverage/samples.h"
#include "stages/coverage/slab_facet.h"
#include "stages/coverage/voxel.h"
#include "stages/data/levels.h"

namespace lamina::cover {

struct LayerReport;

/// One row after the other; keeps its buffers.
///
/// A facet adds to a column the volume that lies behind it there, and to all columns behind its area along x: their volume is
/// area x width. Sums run along the row; where a column holds no facet the winding number is whole, so errors do not outlive
/// a stretch of columns with facets, and rationals look no further back.
class RowMaker {
 public:
  /// Appends the levels of a row to `out` and ends it; adds to `report`, volumes in nm^3.
  /// row  indices of facets that may reach the row; their columns are written
  void make(const Strip& strip, const PixelAxis& columns, const Edges& edges, const Rule& rule, std::span<SlabFacet> facets,
            std::span<const std::uint32_t> row, Levels& out, LayerReport& report);

  std::uint64_t bytes() const { return cells_.bytes() + samples_.bytes(); }

 private:
  /// A stretch of columns that hold facets, up to where the row has been made.
  struct Stretch {
    std::uint32_t first = 0;
    std::int64_t winding = 0;  // before it
    double cover = 0;          // nm^2, behind the facets so far
    double scale = 0;          // as in Cell, of all of them
    double facets = 0, columns = 0;
    std::int64_t held = 0, suspects = 0;  // facets that reach the column
  };
  struct Job {
    const Strip& strip;
    const PixelAxis& columns;
    const Edges& edges;
    const Rule& rule;
    std::span<const SlabFacet> facets;
    std::span<const std::uint32_t> row;
    Levels& out;
    LayerReport& report;
    double area, margin;  // nm^2 of the strip's section; the share that is spoilt for each nm that corners are off
  };

  void add(const Strip& strip, const Edges& edges, SlabFacet& facet);
  void sweep(const Job& job);
  void pass_free(const Job& job, const Stretch& stretch, std::uint32_t begin, std::uint32_t end);
  void pass_even(const Job& job, const Stretch& stretch, std::uint32_t begin, std::uint32_t end);
  std::uint8_t level(const Job& job, const Stretch& stretch, std::uint32_t column, double volume, double& share);
  std::uint8_t decide(const Job& job, const Stretch& stretch, std::uint32_t column, double share);
  void look(const Job& job, const Stretch& stretch, std::uint32_t column);

  RowCells cells_;
  Samples samples_;
};

}  // namespace lamina::cover
