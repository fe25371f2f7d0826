// pipeline/job/machine.h: what a job says of the machine that it is for, and of the binder that goes where.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/raster/beads.h"

namespace lamina::pipeline {

/// A profile with the job's changes to it, and the grid that follows.
struct ResolvedMachine {
  Machine machine;
  HeadGrid grid;
};

/// [machine] of a job.
struct MachineRequest {
  std::string profile;                                // a shipped one's name, or a file; empty: none
  std::optional<double> scan_speed_mm_s;              // instead of the profile's
  std::optional<std::vector<std::uint32_t>> blocked;  // instead of the profile's
  bool bed_given = false, dpi_given = false;          // bed.size_mm, bed.dpi: asked of the machine
  bool decides_bed = false;                           // the job's bed is that of a machine, so no other can be asked for
  std::shared_ptr<const ResolvedMachine> resolved;    // by resolve_machine; decides the grid of the images
};

/// [dose] of a job: how much binder goes where (stages/dose/).
struct DoseRequest {
  std::array<double, 2> bleed_um{0, 0};                   // along x and y: pixels nearer to the edge than this are left out
  double shell_mm = 0;                                    // so deep all pixels are set; only with a core below 1 or beads
  double core = 1;                                        // share of the pixels inside of the shell that is set
  raster::BeadEnds bead_ends = raster::BeadEnds::kRound;  // of beads that fill a part, and where thick becomes thin
};

}  // namespace lamina::pipeline
