// pipeline/pores/bead_rules.h: by which printer's rules the beads of a toolpath file come to lie.
#pragma once

#include <optional>
#include <string>

#include "stages/bead/deposition.h"
#include "stages/data/status.h"
#include "stages/formats/gcode/read_gcode.h"

namespace lamina::pipeline {

struct BeadRules {
  std::optional<bead::DepositionRules> rules;  // none: beads are as wide as the file states
  std::string reported;                        // for people: where widths come from
};

/// beads    "spread": by the bead model (docs/bead.md); "deposited": the same, without spread along their lines; "stated" by
///          the file; or "": spread where the printer is known
/// machine  as --machine takes it; "": the one that the file names, if a profile of that name is shipped
/// errors   kUsage: an unknown printer or word; "deposited" or "spread" without a printer
Result<BeadRules> bead_rules(const formats::GcodeFile& file, const std::string& beads, const std::string& machine);

}  // namespace lamina::pipeline
