#include "stages/bead/machine.h"

#include <fmt/format.h>

#include <cmath>

namespace lamina::bead {

Status check(const BeadMachine& machine) {
  const auto wrong = [](const char* key, double value, const char* what) {
    return Error{Fault::kUsage, fmt::format("bead.{}: {}{}", key, value, what)};
  };
  const auto& [area, tau, acceleration] = machine;
  if (!(std::isfinite(area) && area > 0)) return wrong("area_mm2", area, " mm2; the cross-section of 100 % has to be above 0");
  if (!(std::isfinite(tau) && tau >= 0)) return wrong("tau_s", tau, " s; a lag has to be 0 or above");
  if (!(acceleration > 0)) return wrong("acceleration_mm_s2", acceleration, " mm/s2; an acceleration has to be above 0");
  return {};
}

}  // namespace lamina::bead
