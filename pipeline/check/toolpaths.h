// pipeline/check/toolpaths.h: checks a G-code file by a replay, and one of lamina against its plan.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/check/model_layers.h"
#include "pipeline/check/planned_beads.h"
#include "pipeline/check/verify.h"
#include "pipeline/report/summary.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/formats/gcode/replay/replay.h"

namespace lamina::pipeline {

/// What a replay of a file found.
struct ToolpathCheck {
  formats::gcode::ReplayReport replay;
  std::string machine;  // whose limits were compared; empty: none
  std::optional<PlanComparison> plan;
  std::optional<ModelComparison> model;

  /// Lines for people: sums, then a line for each kind of note.
  Summary::Lines lines() const;
  /// Sums, and all kinds of defects.
  Json json() const;
};

/// Replays a file. Each kind of fault becomes one of `faults`.
///
/// head    of the file's manifest, whose machine is used where options name none; null: it has none
/// errors  kUsage: no such machine; no G-code
Result<ToolpathCheck> check_toolpaths(const std::string& path, const ToolpathOptions& options, const ManifestHead* head,
                                      Faults& faults);

}  // namespace lamina::pipeline
