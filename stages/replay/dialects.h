// stages/replay/dialects.h: readers of print programs, one per dialect; stages/program/ documents the formats.
#pragma once

#include <string_view>

#include "stages/replay/printing.h"

namespace lamina::replay {

/// Each reads a layer's program, the whole file. An invalid program sets the fault of the printing.
void read_nuferbj(std::string_view text, Printing& printing);
void read_raw(std::string_view text, Printing& printing);
void read_planes(std::string_view text, Printing& printing);
void read_hp45(std::string_view text, Printing& printing);
void read_oasis(std::string_view text, Printing& printing);
void read_brundlefab(std::string_view text, Printing& printing);
void read_m578(std::string_view text, Printing& printing);

}  // namespace lamina::replay
