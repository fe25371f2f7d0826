// pipeline/machine/powder_printer.h: the machine of a job: found, changed as asked, checked.
#pragma once

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/heights/table.h"

namespace lamina::pipeline {

/// A profile and its grid, with the dialect checked. errors  of make_head_grid and check_dialect
Result<ResolvedMachine> resolve_profile(const Machine& machine);

/// Finds the machine that a job asks for and sets what follows from it: job.machine.resolved and job.bed_mm. Does
/// nothing for a job without a machine. bed.dpi, if given, are asked of the head: across the scan the number of
/// interlaced passes follows, along it the length of a pixel.
/// errors  kUsage: no such machine, a dpi that the head cannot reach, another bed
Status resolve_machine(Job& job);

/// Whether all parts stand on the bed and below the build height.
/// errors  kUsage with the part and its first place outside
Status check_reach(const Job& job, const Scene& scene);

/// Whether the build vat can make these layers: empty, or a warning if some end between two of its steps.
/// errors  kUsage: a layer thinner than a step
Result<std::string> check_build_steps(const Job& job, const heights::LayerTable& table);

}  // namespace lamina::pipeline
