// pipeline/machine/powder_printer.h: the machine of a job: found, changed as asked, checked.
#pragma once

#include <array>
#include <memory>

#include "pipeline/job/job.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// A profile and its grid, with the dialect checked. errors  of make_head_grid and check_dialect
Result<ResolvedMachine> resolve_profile(const Machine& machine);

/// What the images of a job are planned for: its machine, or a bare bed.
struct PowderPrinter {
  std::shared_ptr<const ResolvedMachine> machine;  // null: the job names none
  std::array<double, 2> bed_mm{};
  PixelGrid grid;  // of the images
};

/// Finds the machine that a job asks for; without one, the bed and the dpi are the job's. bed.dpi, if given, are asked of
/// the head: across the scan the number of interlaced passes follows, along it the length of a pixel.
/// errors  kUsage: no such machine, a dpi that the head cannot reach, another bed
Result<PowderPrinter> resolve_powder_printer(const Job& job);

/// The same, kept in the job: sets job.machine.resolved, decides_bed and job.bed_mm; nothing for a job without a machine.
Status resolve_machine(Job& job);

}  // namespace lamina::pipeline
