// pipeline/cli/pore_print.h: lamina permeability of toolpaths.
#pragma once

#include <optional>

#include "pipeline/cli/command.h"
#include "stages/data/mesh.h"

namespace lamina::pipeline {

/// What flows through a window of the beads of a G-code file, or a scan of it beside its plan.
/// part  as WindowRequest takes it
Outcome predict_print(const Arguments& arguments, Context& context, const std::optional<Box>& part);

}  // namespace lamina::pipeline
