// pipeline/machine/import/slicer_code.h: start, end and layer code of another slicer with lamina's placeholders.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "pipeline/machine/import/slicer_settings.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Translates [name] and {name}: temperatures become lamina's placeholders, other settings and arithmetic of them their values.
/// key     of the code, for messages; layer code has the number and height of the layer
/// notes   receives the temperatures that became numbers
/// errors  kUsage: a condition, or a name that has no value before the job is planned
Result<std::string> translate_code(std::string_view key, const std::string& code, SlicerSettings& settings,
                                   std::vector<std::string>& notes);

/// PrusaSlicer heats the bed before start code and the nozzle before and after it, where the code has no command for it
/// (GCode.cpp: _print_first_layer_bed_temperature). The code with these commands.
std::string with_heating(const std::string& start);

}  // namespace lamina::pipeline
