// pipeline/show/report_warnings.h: the warnings of a finished job, from its files.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <cstdint>
#include <memory>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "pipeline/plan/scene.h"
#include "pipeline/run/layer_imager.h"
#include "stages/checks/solid_checks.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

class ReportBleed {
 public:
  /// Null where no bleed goes inwards, or beads fill the parts. machine  null without one. scene  the parts, which are copied
  static std::unique_ptr<ReportBleed> make(const Manifest& manifest, const Job& job, const Machine* machine,
                                           const Scene& scene);

  /// Makes a layer as it was before the bleed, and moves its edges; from many threads at once.
  void inspect(const Layer& layer);
  void report(std::vector<Warning>& warnings) const;

 private:
  ReportBleed() = default;

  Plan plan_;
  std::vector<Layer> layers_;
  std::vector<checks::VanishedPieces> vanished_;  // by layer
  tbb::enumerable_thread_specific<ImageWork> work_;
};

class ReportWarnings {
 public:
  /// machine  null without one
  /// scene    the parts; null: their boxes as the manifest has them, without volumes. Manifest and machine must outlive this
  ///          object.
  ReportWarnings(const Manifest& manifest, const Job& job, const Machine* machine, const Scene* scene);

  /// An image as in its file; from many threads at once.
  void inspect(const Layer& layer, RowRuns image);

  /// set  pixels of each layer. returns  none for a job of some layers only
  std::vector<Warning> report(const std::vector<std::uint64_t>& set) const;

 private:
  void plan_again(const Machine* machine, const Scene& scene);
  void plan_paths_again();
  void inspect_records();

  const Manifest& manifest_;
  Job job_;
  std::vector<Warning> reports_;        // by the plan and the records of layers, as lamina jet reports them
  std::unique_ptr<ReportBleed> bleed_;  // null: it takes nothing, or the parts are not there
  std::unique_ptr<checks::Tally> tally_;
  std::vector<std::uint8_t> crossed_;                       // by layer: whether it may not be empty
  std::function<Result<double>(std::uint32_t)> union_mm3_;  // of a group; empty without the parts
};

}  // namespace lamina::pipeline
