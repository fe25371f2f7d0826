// tests/bead/stabilisation.cpp: the lag with which a bead is as wide again after the measured way.
#include "tests/bead/stabilisation.h"

#include <algorithm>
#include <cmath>

#include "stages/bead/line.h"
#include "stages/data/buffer.h"

namespace lamina::bead {
namespace {

double area_after(const BeadMachine& machine, double from, const StableAfter& row, double tau) {
  double ramp = 0, flow = machine.area_mm2 * from;
  if (std::isfinite(machine.acceleration_mm_s2)) {
    ramp = (row.speed_mm_s * row.speed_mm_s - from * from) / (2 * machine.acceleration_mm_s2);
    const FlowPhase rising{ramp, machine.area_mm2, from, machine.acceleration_mm_s2, tau, flow};
    if (row.distance_mm <= ramp) return rising.area_at(row.distance_mm);
    flow = rising.flow_after(rising.time_at(ramp));
  }
  return FlowPhase{row.distance_mm, machine.area_mm2, row.speed_mm_s, 0, tau, flow}.area_at(row.distance_mm - ramp);
}

}  // namespace

double time_constant(const BeadMachine& machine, const StabilisationTest& test, const StableAfter& row) {
  const double before = width_of(machine.area_mm2, true, test.height_mm);
  double low = 0, high = 10;  // s; no bead printer lags longer
  for (int i = 0; i < 60; ++i) {
    const double tau = (low + high) / 2;
    const double area = area_after(machine, test.speed_mm_s, row, tau);
    (width_of(area, true, test.height_mm) < before - test.resolution_mm ? high : low) = tau;
  }
  return low;
}

double time_constant(const BeadMachine& machine, const StabilisationTest& test, std::span<const StableAfter> rows) {
  Buffer<double> taus;
  for (const StableAfter& row : rows) taus.push_back(time_constant(machine, test, row));
  if (taus.empty()) return 0;
  std::sort(taus.begin(), taus.end());
  return (taus[taus.size() / 2] + taus[(taus.size() - 1) / 2]) / 2;
}

}  // namespace lamina::bead
