// pipeline/plan/porous_plan.h: a powder job whose parts are laid as beads instead of solid, so that planned pores are printed
// without being modelled.
//
//   section ─> contours ─> walls, filling ─> thick and thin stretches ─> pixels of beads ─┐
//   part's exact image ─────────────────────────────────────────────────────────> both ──┴─> with its shell ─> image
//
// The filling is that of `lamina slice` and `lamina extrude`, key for key. Beads have the widths that are asked for:
// there is no melt that spreads, so a segmented line needs no calibration.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/plan/segment.h"
#include "pipeline/run/slice.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/dose/erode.h"
#include "stages/raster/beads.h"

namespace lamina::pipeline {

/// What a layer of beads occupies while it is in flight.
struct PorousWork {
  explicit PorousWork(const PixelGrid& grid) : beads(grid) {}
  std::uint64_t bytes() const;

  SlicePlan::Work plan;
  raster::BeadRaster beads;
  Runs laid;   // pixels of beads
  Runs inner;  // below the shell
};

class PorousPlan {
 public:
  /// Whether the job asks for walls, a filling or segmented lines, for any of its parts.
  /// errors  of plan_filling
  static Result<bool> asked(const Job& job);

  /// Loads and slices the parts. Absent widths of [segment] are: thick and continuous fill.width_mm, thin half of it.
  /// errors  kUsage: keys that have no meaning together with a filling; of plan_segments and SlicePlan::make
  static Result<PorousPlan> make(const Job& job, const PixelGrid& grid, const ProgressCallback& progress);

  const SlicePlan& slices() const { return *slices_; }
  const std::vector<std::string>& warnings() const { return warnings_; }

  /// Leaves those pixels of the part that beads cover or that lie in its shell; none is added.
  /// image    the part's, row 0 at the back (before any mirror)
  /// scratch  of the image's kind
  /// errors   of SlicePlan::layer and layer_cut
  Status apply(const Layer& layer, Runs& image, Runs& scratch, std::unique_ptr<PorousWork>& work) const;

  /// Pieces of bead rows that a layer is expected to have: an image has at most two changes for each.
  std::uint64_t spans_expected(std::uint32_t layer) const;
  /// What a layer is expected to need beside its images.
  std::uint64_t bytes_expected(std::uint32_t layer) const;

 private:
  PorousPlan() = default;

  PixelGrid grid_;
  std::unique_ptr<SlicePlan> slices_;
  std::unique_ptr<SegmentPlan> segments_;
  raster::BeadEnds ends_ = raster::BeadEnds::kRound;
  dose::Reach shell_;
  std::vector<std::string> warnings_;
};

/// [fill] and [segment] of a job, as its manifest records them where they decide bytes.
std::string filling_text(const Job& job);

}  // namespace lamina::pipeline
