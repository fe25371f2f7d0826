// pipeline/machine/powder_printer.h: finds, changes and checks the powder printer of a job.
#pragma once

#include <array>
#include <optional>

#include "pipeline/job/job.h"
#include "stages/data/grid.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/status.h"
#include "stages/support/text/value.h"  // kMostMm

namespace lamina::pipeline {

/// The bed under the parts.
struct Bed {
  std::array<double, 2> size_mm = kBareBedMm;
  bool of_machine = false;  // fixed by the machine
};

/// For parts without a printer.
inline constexpr Bed kLargestBed{{kMostMm, kMostMm}};
/// The bed of a job without a machine.
inline Bed bare_bed(const Job& job) { return {job.bed_mm.value_or(kBareBedMm), false}; }

/// A profile with the job's changes, and the resulting grid.
struct ResolvedMachine {
  Machine machine;
  HeadGrid grid;
};

/// A profile and its grid, with the dialect checked. errors  of make_head_grid and check_dialect
Result<ResolvedMachine> resolve_profile(const Machine& machine);

/// The target of a job's images: its machine, or a bare bed.
struct PowderPrinter {
  std::optional<ResolvedMachine> machine;  // absent without a machine
  Bed bed;
  PixelGrid grid;  // of the images
};

/// Finds the machine of a job; without one, bed and dpi are the job's. A given bed.dpi configures the head: the number of
/// interlaced passes across the scan, and the pixel length along it.
/// errors  kUsage: no such machine, a dpi that the head cannot reach, a bed that differs from the machine's
Result<PowderPrinter> resolve_powder_printer(const Job& job);

}  // namespace lamina::pipeline
