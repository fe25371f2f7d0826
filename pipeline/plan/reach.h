// pipeline/plan/reach.h: whether the machine of a job can print its parts and its layers.
#pragma once

#include <string>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/heights/table.h"

namespace lamina::pipeline {

/// Whether all parts stand on the bed and below the build height.
/// errors  kUsage with the part and its first place outside
Status check_reach(const Job& job, const Scene& scene);

/// Whether the build vat can make these layers: empty, or a warning if some end between two of its steps.
/// errors  kUsage: a layer thinner than a step
Result<std::string> check_build_steps(const Job& job, const heights::LayerTable& table);

}  // namespace lamina::pipeline
