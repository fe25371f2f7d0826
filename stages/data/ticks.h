// stages/data/ticks.h: round numbers along the axes of plots.
#pragma once

#include <cmath>

namespace lamina {

/// 1, 2 or 5 times a power of ten, so that about `count` steps cover `span`; both above 0.
inline double tick_step(double span, int count) {
  const double raw = span / count, power = std::pow(10, std::floor(std::log10(raw)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= raw) return factor * power;
  }
  return 10 * power;
}

}  // namespace lamina
