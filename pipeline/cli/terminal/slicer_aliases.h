// pipeline/cli/terminal/slicer_aliases.h: the options of other slicers, and what they are called here.
#pragma once

#include <string>
#include <string_view>

#include "pipeline/cli/terminal/arguments.h"

namespace lamina::pipeline {

/// "; did you mean '--layer'?" for an option of PrusaSlicer, Slic3r or CuraEngine whose counterpart the command has, with
/// what differs; "; lamina makes no supports" for what lamina does not make; else "". Sources: PrusaSlicer
/// src/libslic3r/PrintConfig.cpp, Cura fdmprinter.def.json.
std::string slicer_alias(std::string_view flag, const CommandSpec& spec);

}  // namespace lamina::pipeline
