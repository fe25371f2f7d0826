// pipeline/run/progress_estimate.h: the time that is over before each layer, for displays. Layers are written before later ones
// are planned, so it is estimated from sampled layers, which are planned twice.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
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
  /// raft         s, of the layers of a raft, which come before
  /// seconds_of   the time of a layer; called by many threads at once
  /// errors       of seconds_of
  static Result<ProgressEstimate> make(std::uint32_t first, std::uint32_t end, const std::vector<double>& raft,
                                       const std::function<Result<double>(std::uint32_t)>& seconds_of);

  using Progress = formats::LayerSurroundings::Progress;
  /// At the start of a layer, of the raft or else of the parts; none if nothing was estimated.
  std::optional<Progress> before_raft(std::uint32_t layer) const { return at(layer); }
  std::optional<Progress> before(std::uint32_t layer) const { return at(raft_ + layer - first_); }

 private:
  /// layer  of the file, from 0
  std::optional<Progress> at(std::uint32_t layer) const;

  std::uint32_t first_ = 0, raft_ = 0;
  std::vector<double> over_;  // s, before each layer of the file and after the last
};

}  // namespace lamina::pipeline
