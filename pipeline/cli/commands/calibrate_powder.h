// pipeline/cli/commands/calibrate_powder.h: lamina calibrate of powder printers.
#pragma once

#include "pipeline/cli/command.h"

namespace lamina::pipeline {

/// Options that are of powder printers alone.
std::vector<OptionSpec> powder_calibration_options();
Outcome calibrate_powder(const Arguments& arguments, Context& context);

}  // namespace lamina::pipeline
