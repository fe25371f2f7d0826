// pipeline/plan/beads.h: a powder job whose parts consist of beads, which print planned pores
// without modelling them.
//
//   section ─> contours ─> walls, filling ─> thick and thin stretches ─> pixels of beads ─┐
//   part's exact image ─────────────────────────────────────────────────────────> both ──┴─> with its shell ─> image
//
// The filling uses the same keys as `lamina slice` and `lamina extrude`. Bead widths come from the job: powder beads do
// not spread, so a segmented line needs no calibration.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/sections.h"
#include "pipeline/plan/segment.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/dose/edges.h"
#include "stages/raster/beads.h"

namespace lamina::pipeline {

/// Scratch for a layer of beads in flight.
struct BeadWork {
  BeadWork(const PixelGrid& grid, Isa isa) : beads(grid, isa) {}
  std::uint64_t bytes() const;

  Sections::Work sections;
  raster::BeadRaster beads;
  Runs inner;  // below the shell
};

/// Plans segmented lines of powder beads and adds the resulting line distances to `fill`. Default widths of [segment]:
/// thick and continuous fill.width_mm, thin half of it.
/// warnings  receives the expected defects of the plan
/// errors    kUsage: keys that conflict with a filling; of plan_segments
Result<SegmentPlan> plan_bead_segments(const Job& job, FillRequest& fill, std::vector<Warning>& warnings);

/// The beads of any layer; immutable, usable from any thread. Sections and segments must outlive it.
class Beads {
 public:
  Beads(const Job& job, const PixelGrid& grid, const Sections& sections, const SegmentPlan& segments);

  /// Collects the walls and the filling of a layer in work.beads. work.sections holds the filled layer.
  /// errors  of layer_cut
  Status deposit(const Layer& layer, BeadWork& work) const;
  /// Clears all pixels of the part outside the beads and the shell; sets none.
  /// image    the part's, row 0 at the back (before any mirror)
  /// scratch  of the image's kind
  void apply(Runs& image, Runs& scratch, BeadWork& work) const;

  /// Expected beads of a layer, and rows that they cover: an image has at most two changes for each of these.
  struct Expected {
    std::uint64_t beads = 0, spans = 0;
  };
  Expected expected(std::uint32_t layer) const;
  /// Expected bytes of a layer in addition to its images.
  std::uint64_t bytes_expected(std::uint32_t layer) const;

 private:
  PixelGrid grid_;
  const Sections* sections_;
  const SegmentPlan* segments_;
  raster::BeadEnds ends_;
  dose::Reach shell_;
};

}  // namespace lamina::pipeline
