// pipeline/show/report_overhangs.h: what hangs over air in the layers of a finished job of toolpaths.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/plan/scene.h"
#include "pipeline/show/report_head.h"
#include "stages/checks/overhang_tally.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct ReportOverhangs {
  checks::OverhangTally tally;
  std::vector<double> area_mm2;           // of each layer
  std::vector<ReportLocation> positions;  // of the largest ones
};

/// Slices the parts in the layers of the manifest, in parallel. Nothing for a job of some layers only.
/// drawn   nm of the machine: what the pictures show
/// errors  of Sections::make and Overhangs::at
Result<ReportOverhangs> overhangs_of_job(const Manifest& manifest, const Job& job, const Scene& scene, const Box& drawn);

}  // namespace lamina::pipeline
