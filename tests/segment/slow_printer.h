// tests/segment/slow_printer.h: the printer that pores are designed for in tests.
#pragma once

#include "stages/data/extruder.h"

namespace lamina::test {

/// Feeds 85 % of the rectangle, as the profile anet-a8 does; 15 mm/s and 400 mm/s2.
inline Extruder slow_printer() {
  Extruder machine;
  machine.speed.print_mm_s = 15;
  machine.speed.acceleration_mm_s2 = 400;
  machine.material.bead_area = BeadShape::kRectangle;
  machine.material.flow = 0.85;
  return machine;
}

}  // namespace lamina::test
