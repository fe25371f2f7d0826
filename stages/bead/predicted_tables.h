// stages/bead/predicted_tables.h: the tables of a calibration as the model has them, for machines on which nobody measured any.
//
// Test pieces are those of Di Nisio 2022: a thin stretch between long thick ones, by speed (Table 11) and by extrusion
// (Table 12), and stretches of 1.5 mm in turn (Tables 13 to 15). Against what was measured there: tests/bead/test_tables.cpp.
#pragma once

#include "stages/bead/machine.h"
#include "stages/data/extruder.h"

namespace lamina::bead {

/// machine     area_mm2 > 0 and tau_s > 0
/// width_mm    of what 100 % lays, as it is asked for; widths of the tables are those of the model
/// height_mm   of the layer
/// speed_mm_s  that 100 % means
/// cost        some milliseconds
Calibration predicted_tables(const BeadMachine& machine, double width_mm, double height_mm, double speed_mm_s);

}  // namespace lamina::bead
