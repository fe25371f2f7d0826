// pipeline/plan/reach.h: checks that a powder printer can reach the parts of a job.
#pragma once

#include "pipeline/plan/scene.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Checks that all parts lie on the bed and below the build height.
/// errors  kUsage with the part and its first point outside
Status check_reach(const Machine& machine, const Scene& scene);

}  // namespace lamina::pipeline
