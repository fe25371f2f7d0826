// pipeline/plan/dose.h: the distribution of binder in a job's layers (stages/dose/).
#pragma once

#include "pipeline/job/job.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/dose/erode.h"

namespace lamina::pipeline {

class DosePlan {
 public:
  DosePlan(const Job& job, const PixelGrid& grid);

  /// Whether the dose changes any layer.
  bool any() const { return bleeds() || core_ < 1; }

  bool bleeds() const { return !bleed_.half_width.empty(); }

  /// Removes the bleed from an image. `second` is scratch.
  void remove_bleed(Runs& image, Runs& second) const;
  /// Thins the core of an image without bleed. `second` and `third` are scratch.
  void thin(std::uint32_t layer, Runs& image, Runs& second, Runs& third) const;

  /// Upper bound of an image's changes after both, given those before and the most pixels that its parts cover.
  std::uint64_t changes_bound(std::uint64_t changes, std::uint64_t covered) const;

 private:
  dose::Reach bleed_, shell_;
  double core_;
};

}  // namespace lamina::pipeline
