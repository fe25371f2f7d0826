// pipeline/show/report_bleed.h: what the bleed took of the layers of a finished job, from its parts.
#pragma once

#include <tbb/enumerable_thread_specific.h>

#include <memory>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/plan.h"
#include "pipeline/run/layer_imager.h"

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

}  // namespace lamina::pipeline
