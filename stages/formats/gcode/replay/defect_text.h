// stages/formats/gcode/replay/defect_text.h: what a replay found, in words.
#pragma once

#include <string>
#include <string_view>

#include "stages/formats/gcode/replay/defects.h"

namespace lamina::formats::gcode {

/// One line on a kind of defects: "line 1234: a bead at 150 degC, below the 170 degC at which firmwares feed (layer 12; 7 in
/// all)".
std::string defect_text(Defect kind, const DefectCount& of);
/// A short name: "cold-extrusion".
std::string_view defect_name(Defect kind);

}  // namespace lamina::formats::gcode
