// pipeline/plan/beads.h: a powder job whose parts are beads instead of solid, so that planned pores are printed without
// being modelled.
//
//   section ─> contours ─> walls, filling ─> thick and thin stretches ─> pixels of beads ─┐
//   part's exact image ─────────────────────────────────────────────────────────> both ──┴─> with its shell ─> image
//
// The filling is that of `lamina slice` and `lamina extrude`, key for key. Beads have the widths that the job gives:
// no melt spreads, so a segmented line needs no calibration.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/sections.h"
#include "pipeline/plan/segment.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/dose/erode.h"
#include "stages/raster/beads.h"

namespace lamina::pipeline {

/// What a layer of beads occupies while it is in flight.
struct BeadWork {
  explicit BeadWork(const PixelGrid& grid) : beads(grid) {}
  std::uint64_t bytes() const;

  Sections::Work sections;
  raster::BeadRaster beads;
  Runs laid;   // pixels of beads
  Runs inner;  // below the shell
};

/// Segmented lines of powder beads, and the distances between lines that follow, which `fill` gains. Absent widths of
/// [segment] are: thick and continuous fill.width_mm, thin half of it.
/// warnings  gains what a plan will not do well
/// errors    kUsage: keys that have no meaning together with a filling; of plan_segments
Result<SegmentPlan> plan_bead_segments(const Job& job, FillRequest& fill, std::vector<std::string>& warnings);

/// The beads of any layer; immutable, any thread may ask. Sections and segments outlive it.
class Beads {
 public:
  Beads(const Job& job, const PixelGrid& grid, const Sections& sections, const SegmentPlan& segments);

  /// Walls and filling of a layer as pixels, into work.laid. work.sections holds the filled layer.
  /// errors  of layer_cut
  Status lay(const Layer& layer, BeadWork& work) const;
  /// Leaves those pixels of the part that the laid beads cover or that lie in its shell; none is added.
  /// image    the part's, row 0 at the back (before any mirror)
  /// scratch  of the image's kind
  void apply(Runs& image, Runs& scratch, BeadWork& work) const;

  /// Pieces of bead rows that a layer is expected to have: an image has at most two changes for each.
  std::uint64_t spans_expected(std::uint32_t layer) const;
  /// What a layer is expected to need beside its images.
  std::uint64_t bytes_expected(std::uint32_t layer) const;

 private:
  PixelGrid grid_;
  const Sections* sections_;
  const SegmentPlan* segments_;
  raster::BeadEnds ends_;
  dose::Reach shell_;
};

}  // namespace lamina::pipeline
