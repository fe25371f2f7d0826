// pipeline/machine/extruder.h: the extrusion printer of a job.
#pragma once

#include "pipeline/job/job.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Finds the job's printer (default: marlin) and applies the job's changes to it.
/// errors  kUsage
Result<ExtruderProfile> resolve_extruder(const Job& job);

}  // namespace lamina::pipeline
