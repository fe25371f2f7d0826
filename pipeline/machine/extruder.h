// pipeline/machine/extruder.h: the extrusion printer of a job.
#pragma once

#include <string_view>

#include "pipeline/job/job.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Finds the job's printer (default: marlin) and applies the job's changes to it.
/// errors  kUsage
Result<ExtruderProfile> resolve_extruder(const Job& job);

/// Whether a file, an option or --set gave the key, as in "fill.walls".
bool is_named(const Job& job, std::string_view key);

/// Replaces the defaults of powder jobs by the printer's where nobody named a value: one wall, layers of half of the nozzle.
void leave_to_machine(const Extruder& machine, Job& job);

}  // namespace lamina::pipeline
