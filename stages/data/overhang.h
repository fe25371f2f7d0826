// stages/data/overhang.h: the areas of a layer that hang over air.
#pragma once

#include <cstddef>
#include <vector>

#include "stages/data/contours.h"

namespace lamina {

/// A connected area.
struct OverhangSpot {
  double area_mm2 = 0;
  Point2 at{};        // a point in it, nm on the bed
  Point2 lo{}, hi{};  // of its box
};

struct LayerOverhang {
  static constexpr std::size_t kMaxSpots = 8;
  double area_mm2 = 0;
  std::vector<OverhangSpot> spots;  // the largest ones, largest first, at most kMaxSpots
};

}  // namespace lamina
