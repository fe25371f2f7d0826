// pipeline/machine/powder_printer.h: the machine of a job: found, changed as asked, checked.
#pragma once

#include <array>
#include <optional>

#include "pipeline/job/job.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/status.h"
#include "stages/text/value.h"  // kMostMm

namespace lamina::pipeline {

/// The bed that parts stand on.
struct Bed {
  std::array<double, 2> size_mm = kBareBedMm;
  bool of_machine = false;  // no other can be asked for
};

/// Of parts that are looked at without a printer.
inline constexpr Bed kLargestBed{{kMostMm, kMostMm}};
/// That of a job without a machine.
inline Bed bare_bed(const Job& job) { return {job.bed_mm.value_or(kBareBedMm), false}; }

/// A profile with the job's changes to it, and the grid that follows.
struct ResolvedMachine {
  Machine machine;
  HeadGrid grid;
};

/// A profile and its grid, with the dialect checked. errors  of make_head_grid and check_dialect
Result<ResolvedMachine> resolve_profile(const Machine& machine);

/// What the images of a job are planned for: its machine, or a bare bed.
struct PowderPrinter {
  std::optional<ResolvedMachine> machine;  // absent: the job names none
  Bed bed;
  PixelGrid grid;  // of the images
};

/// Finds the machine that a job asks for; without one, the bed and the dpi are the job's. bed.dpi, if given, are asked of
/// the head: across the scan the number of interlaced passes follows, along it the length of a pixel.
/// errors  kUsage: no such machine, a dpi that the head cannot reach, another bed
Result<PowderPrinter> resolve_powder_printer(const Job& job);

}  // namespace lamina::pipeline
