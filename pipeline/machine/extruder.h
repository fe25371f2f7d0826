// pipeline/machine/extruder.h: the extrusion printer of a job.
#pragma once

#include "pipeline/job/job.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Finds the printer that a job asks for, marlin if it names none, and changes it as the job says.
/// errors  kUsage
Result<ExtruderProfile> resolve_extruder(const Job& job);

}  // namespace lamina::pipeline
