// tests/bead/stabilisation.h: the lag of a hot end from where a bead is as wide again as before the speed rose.
//
// A line deposited evenly continues at a higher speed; its width drops and comes back. The distance is measured by ruler,
// and no width of the thin bead is needed: Di Nisio 2022, Table 11, column "stabilisation distance". "As wide again" is as near
// to the width before as widths can be distinguished. The constant depends only on that and the distances, and near
// 100 % it decides (0.03 s at 125 %): hence the median.
#pragma once

#include <span>

#include "stages/bead/line.h"

namespace lamina::bead {

struct StableAfter {
  double speed_mm_s;   // of the thin segment, above that of the line before
  double distance_mm;  // from where it begins
};

struct StabilisationTest {
  double height_mm = 0.3;
  double speed_mm_s = 15;       // of the line before
  double resolution_mm = 0.01;  // to which widths are measured
};

/// The lag, s, by one row. machine  area and acceleration; its lag is not read
/// returns  0 where the bead came back before any lag could show
double time_constant(const BeadMachine& machine, const StabilisationTest& test, const StableAfter& row);

/// The median of all rows. errors  none; without rows 0
double time_constant(const BeadMachine& machine, const StabilisationTest& test, std::span<const StableAfter> rows);

}  // namespace lamina::bead
