// pipeline/cli/pore_print.h: lamina permeability of toolpaths.
#pragma once

#include "pipeline/cli/command.h"

namespace lamina::pipeline {

/// What flows through a window of the beads of a G-code file, or a scan of it beside its plan.
Outcome predict_print(const Arguments& arguments, Context& context);

}  // namespace lamina::pipeline
