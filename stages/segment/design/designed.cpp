#include "stages/segment/design/designed.h"

#include <fmt/format.h>

#include <cmath>

namespace lamina::segment {

double miss_of(const PoreWish& wish, const ForwardRun& forward) {
  Slots slots{forward.porosity, forward.permeability_m2, 0};
  Pores pores{};
  pores.width_mm = forward.pore_width_mm;
  pores.length_mm = forward.pore_length_mm;
  return miss_of(wish, slots, pores);
}

std::vector<std::string> outside_of(const DesignLimits& limits, const Choice& choice) {
  const auto beyond = limits.beyond(choice);
  std::vector<std::string> lines;
  const auto add = [&](std::size_t i, std::string text) {
    if (std::abs(beyond[i]) > 0.02) lines.push_back(std::move(text));
  };
  add(0, fmt::format("extrusion {:.1f} % lies between those measured", choice.extrusion));
  add(1, fmt::format("thick stretches of {:.2f} mm; 1.5 were measured", choice.thick_mm));
  add(2, fmt::format("thin stretches of {:.2f} mm; 1.5 to 2 were measured", choice.thin_mm));
  add(3, fmt::format("thick beads {:+.4f} mm from their neighbours; 0 to 0.01 were measured", choice.gap_mm));
  return lines;
}

}  // namespace lamina::segment
