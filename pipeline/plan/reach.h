// pipeline/plan/reach.h: whether a powder printer can print the parts of a job.
#pragma once

#include "pipeline/plan/scene.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Whether all parts stand on the bed and below the build height.
/// errors  kUsage with the part and its first place outside
Status check_reach(const Machine& machine, const Scene& scene);

}  // namespace lamina::pipeline
