// pipeline/check/planned_beads.h: plans a recorded job again and compares the beads of its file with the planned ones.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct PlanComparison {
  std::string reason;                                              // why nothing was compared; empty: compared
  std::uint64_t planned = 0, missing = 0, added = 0, changed = 0;  // beads; changed: of another width or volume
};

/// Plans the job of a manifest once more, in a temporary file, and compares layers and beads: ends, type, width and volume of
/// each.
///
/// folders  that are searched for the parts, or files
/// machine  in place of the recorded one; empty: that
/// faults   a line for each layer and kind of difference
/// errors   of the run; kUsage: the file cannot be read
/// cost     that of the job, and both files once; memory of a layer of each
Result<PlanComparison> compare_with_plan(const std::string& path, const ManifestHead& head,
                                         const std::vector<std::string>& folders, const std::string& machine, Faults& faults);

}  // namespace lamina::pipeline
