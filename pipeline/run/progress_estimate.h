// pipeline/run/progress_estimate.h: the time that is over before each layer, for displays. Layers are written before later ones
// are planned, so it is estimated from sampled layers, which are planned twice.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "stages/data/status.h"
#include "stages/formats/extrusion_format.h"

namespace lamina::pipeline {

/// Depends on the job alone: the same for any number of threads, and in a job that resumes. Exact for jobs of up to kSamples
/// layers, without travels between layers; between samples the time of a layer is interpolated.
class ProgressEstimate {
 public:
  static constexpr std::uint32_t kAllUpTo = 500, kSamples = 64;

  ProgressEstimate() = default;
  /// first, end   layers of the file
  /// seconds_of   the time of a layer; called by many threads at once
  /// errors       of seconds_of
  static Result<ProgressEstimate> make(std::uint32_t first, std::uint32_t end,
                                       const std::function<Result<double>(std::uint32_t)>& seconds_of);

  /// At the start of a layer; none if nothing was estimated.
  std::optional<formats::LayerSurroundings::Progress> before(std::uint32_t layer) const;

 private:
  std::uint32_t first_ = 0;
  std::vector<double> over_;  // s, before each layer and after the last
};

}  // namespace lamina::pipeline
