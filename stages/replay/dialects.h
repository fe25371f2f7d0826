// stages/replay/dialects.h: readers of print programs, one a dialect; the formats are told in stages/write/program/.
#pragma once

#include <string_view>

#include "stages/replay/printing.h"

namespace lamina::replay {

/// Each reads the program of a layer, the whole file. The printing has the fault if it is not one.
void read_nuferbj(std::string_view text, Printing& printing);
void read_raw(std::string_view text, Printing& printing);
void read_planes(std::string_view text, Printing& printing);
void read_hp45(std::string_view text, Printing& printing);
void read_brundlefab(std::string_view text, Printing& printing);
void read_m578(std::string_view text, Printing& printing);

}  // namespace lamina::replay
