// stages/coverage/row.h: facets of a layer become the levels of one row of voxels.
#pragma once

#include <cstdint>
#include <span>

#include "stages/coverage/edges.h"
#include "stages/coverage/facet_walk.h"
#include "stages/coverage/plane_steps.h"
#include "stages/coverage/row_cells.h"
#include "stages/coverage/row_tents.h"
#include "stages/coverage/samples.h"
#include "stages/coverage/slab_facet.h"
#include "stages/coverage/voxel.h"
#include "stages/data/buffer.h"
#include "stages/data/levels.h"

namespace lamina::cover {

struct LayerReport;

/// One row after the other, from the back of the bed; keeps its buffers.
///
/// A facet adds to a column the volume that lies behind it there, and to all columns behind its area along x: their volume is
/// area x width. Where a column holds no facet the winding number is whole, so errors do not outlive a stretch of columns with
/// facets, and rationals look no further back. Where facets meet no others, steps of levels are found and columns between them
/// are not looked at: those of a facet alone are steps of a plane (plane_steps.h), and where all facets enter, or all leave,
/// levels only rise or only fall.
class RowMaker {
 public:
  /// What all rows of a layer share; outlives the layer.
  struct Slab {
    const PixelAxis& columns;
    const Edges& edges;
    Rule rule;
    VoxelSides sides;
    double bottom;
    std::span<const SlabFacet> facets;
  };

  void start(const Slab& slab);
  /// The facet begins in the row that is made next.
  void enter(const SlabFacet& facet, std::uint32_t index);
  bool is_empty() const { return row_.empty(); }
  /// Appends the levels of geometry row `row` to `out` and ends it; adds to `report`. Its volume_mm3 is in nm^3, and gets what
  /// the rule and samples change of the volume that facets tell.
  void make(const Slab& slab, const Strip& strip, std::uint32_t row, Levels& out, LayerReport& report);

  std::uint64_t bytes() const {
    return cells_.bytes() + samples_.bytes() + bytes_held(row_) + bytes_held(walk_) + bytes_held(plane_) + bytes_held(step_) +
           bytes_held(tents_);
  }
  /// The same for a layer of so many facets, columns apart.
  static std::uint64_t bytes_of(std::uint64_t facets, std::uint32_t levels);

 private:
  static constexpr std::uint32_t kNone = UINT32_MAX;
  enum class Known : std::uint8_t { kNot, kYes, kNever };

  /// A facet on its way through rows.
  struct Walk {
    FacetWalk walk;
    double from_x, from_y;  // of the facet's lowest corner
    std::uint32_t tents;    // in tents_, or kNone
    std::int8_t sign;       // 1: +x enters; -1: it leaves; 0: it goes along
    bool suspect;
    Known steps;
  };
  struct Job {
    const Slab& slab;
    const Strip& strip;
    Levels& out;
    LayerReport& report;
    double area, margin;  // nm^2 of the strip's section; the share that is spoilt for each nm that corners are off
  };
  /// Columns that hold facets, one next to the other.
  struct Stretch {
    std::span<const RowFacet> facets;
    std::uint32_t first = 0, end = 0;
    std::int64_t winding = 0;             // before it
    double spoilt = -1;                   // bound of errors of shares; negative: nobody has asked yet
    double cover = 0;                     // nm^2, behind the facets so far
    std::uint32_t at = 0;                 // levels are told up to here
    std::int64_t held = 0, suspects = 0;  // facets that reach the column

    std::uint32_t level = 0;            // from column `at` on, as far as is known
    std::int64_t known = 0;             // a column whose level that is; the one before the stretch to begin with
    std::span<const RowFacet> near;     // facets that reach columns behind it, up to those whose level is found next
    bool rises = false, falls = false;  // some of these enter, some leave
  };

  void step(const Job& job, std::uint32_t row);
  std::int64_t pass(const Job& job, Stretch& stretch);
  std::uint8_t decide(const Job& job, Stretch& stretch, std::uint32_t column, double share);

  // Stretches whose steps are found.
  void climb(const Job& job, Stretch& stretch);
  bool climb_plane(const Job& job, Stretch& stretch, const RowFacet& of_row, std::uint32_t begin, std::uint32_t end);
  void between(const Job& job, Stretch& stretch, std::int64_t high, std::uint32_t level);
  void climb_to(const Job& job, Stretch& stretch, std::uint32_t column, std::uint32_t level);
  std::uint32_t level_at(const Job& job, Stretch& stretch, std::uint32_t column);
  const Tents& tents(const Job& job, const RowFacet& of_row);

  // All other stretches.
  void add(const Job& job, const RowFacet& of_row);
  void sweep(const Job& job, Stretch& stretch);
  void pass_free(const Job& job, std::int64_t winding, std::uint32_t begin, std::uint32_t end);
  void pass_even(const Job& job, Stretch& stretch, std::uint32_t begin, std::uint32_t end);
  std::uint8_t level(const Job& job, Stretch& stretch, std::uint32_t column, double volume);

  RowCells cells_;
  Samples samples_;
  Buffer<RowFacet> row_;
  Buffer<Walk> walk_;
  Buffer<PlaneSteps> plane_;
  Buffer<double> step_;
  Buffer<Tents> tents_;
};

}  // namespace lamina::cover
