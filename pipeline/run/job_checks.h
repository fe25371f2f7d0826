// pipeline/run/job_checks.h: checks a whole job before it is finished: does the plan match the parts?
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/plan/plan.h"
#include "stages/checks/solid_checks.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// The solids of a scene. Those whose boxes overlap in x and y, directly or through others, share a group.
std::vector<checks::Solid> solids_from_above(const Scene& scene);
/// How images on a grid see the solids of a job, or contours if it is null. Names of parts are left to the caller.
checks::Sampling sampling_of(const Job& job, const PixelGrid* grid);

/// What the solids of a group hold together (stages/checks/solid_checks.h). Scene, tally and cancel must outlive it.
std::function<Result<double>(std::uint32_t)> union_in(const Scene& scene, const checks::Tally& tally,
                                                      const std::atomic<bool>* cancel = nullptr,
                                                      checks::GroupUnion::Again again = {});

/// Counts while layers are made. Layers that --resume keeps are known by their records alone: then solids are not judged.
class JobChecks {
 public:
  /// The plan and `cancel` must outlive this object.
  JobChecks(const Plan& plan, const std::atomic<bool>& cancel);

  /// For a plan whose layers are decided since; before any is recorded.
  void count_layers();

  // --- from many threads at once
  void add_image(const Layer& layer, const Runs& image) { tally_->add_image(layer, image); }
  /// The image without its bleed, mirrored as the job requests.
  void add_left(const Layer& layer, const Runs& image);
  /// returns  mm2 between the contours
  double add_contours(const Layer& layer, const slice::LayerContours& contours);

  // --- from one thread at a time
  /// filled  whether the layer has pixels, contours or moves
  void record(std::uint32_t layer, bool filled) { filled_[layer] = filled ? 1 : 0; }
  void keep(std::uint32_t layer, bool filled) {
    record(layer, filled);
    kept_ = true;
  }

  /// After the last layer of the run. Jobs of some layers only are not judged.
  /// errors  kInput: a whole job that has nothing, unless that is allowed; kInterrupted and kMemory
  Status end(std::vector<Warning>& warnings) const;

 private:
  std::string why_nothing() const;
  std::vector<std::uint8_t> filled_or_rightly_empty() const;

  const Plan& plan_;
  std::unique_ptr<checks::Tally> tally_;
  std::vector<std::string> names_;
  checks::Sampling sampling_;
  std::vector<std::uint8_t> filled_;  // by layer
  bool kept_ = false;
};

}  // namespace lamina::pipeline
