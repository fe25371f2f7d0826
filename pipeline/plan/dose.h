// pipeline/plan/dose.h: how much binder a job's layers get where (stages/dose/).
#pragma once

#include "pipeline/job/job.h"
#include "stages/data/grid.h"
#include "stages/data/runs.h"
#include "stages/dose/erode.h"

namespace lamina::pipeline {

class DosePlan {
 public:
  DosePlan(const Job& job, const PixelGrid& grid);

  /// Whether a layer is changed at all.
  bool any() const { return !bleed_.half_width.empty() || core_ < 1; }

  /// Takes the bleed away from an image, then binder out of its core. `second` and `third` are scratch.
  void apply(std::uint32_t layer, Runs& image, Runs& second, Runs& third) const;

  /// Changes that an image of so many, whose parts cover so many pixels at most, may have afterwards.
  std::uint64_t changes_bound(std::uint64_t changes, std::uint64_t covered) const;

 private:
  dose::Reach bleed_, shell_;
  double core_;
};

}  // namespace lamina::pipeline
