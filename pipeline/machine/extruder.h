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

/// Whether widths of segmented lines were measured on this printer, or on the one that the documents had.
bool has_measured_widths(const ExtruderProfile& profile);
/// Where none were and the melt's lag is known, the tables of the calibration are those that the model of a bead has for beads
/// and layers of the job (stages/bead/predicted_tables.h), in place of those of another machine.
void predict_calibration(const Job& job, ExtruderProfile& profile);

/// Whether a file, an option or --set gave the key, as in "fill.walls".
bool is_named(const Job& job, std::string_view key);

/// Replaces the defaults of powder jobs by the printer's where nobody named a value: one wall, layers of half of the nozzle.
void leave_to_machine(const Extruder& machine, Job& job);

}  // namespace lamina::pipeline
