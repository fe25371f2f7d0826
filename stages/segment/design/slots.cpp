#include "stages/segment/design/slots.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lamina::segment {
namespace {

constexpr std::size_t kHeights = 32;    // of the upper half of a layer
constexpr std::size_t kPositions = 48;  // of half a thin stretch

/// Half of a bead's width at a height above the middle of its layer, mm.
double half_width(double width, double layer, double above) {
  const double round = std::min(width, layer) / 2;
  if (above >= round) return 0;
  return width / 2 - round + std::sqrt(round * round - above * above);
}

/// A gap that changes with the height.
struct Channel {
  double area = 0, resistance = 0;  // sums of gap and of 12 / gap^3
  double minimum = 1e9;

  void add(double gap) {
    gap = std::max(gap, 0.0);
    area += gap;
    resistance += 12 / (gap * gap * gap);  // infinite where it is closed
    minimum = std::min(minimum, gap);
  }
  double mean_gap() const { return area / kHeights; }
  double conductance() const { return kHeights / resistance; }  // mm3: flow of a mm along the line
};

}  // namespace

Slots slots_of(const Segmentation& plan, double layer_mm) {
  std::array<double, kHeights> thick{}, thin{}, available{}, lines{};
  for (std::size_t k = 0; k < kHeights; ++k) {
    const double above = layer_mm / 2 * (static_cast<double>(k) + 0.5) / kHeights;
    const double continuous = half_width(plan.continuous_width_mm, layer_mm, above);
    thick[k] = half_width(plan.thick_width_mm, layer_mm, above);
    thin[k] = half_width(plan.thin_width_mm, layer_mm, above);
    available[k] = plan.spacing_sc_mm - continuous;
    lines[k] = plan.spacing_cc_mm - 2 * continuous;
  }
  double area = 0, flow = 0;  // mm2 and mm4 of one period's section
  Slots slots;
  const auto add = [&](const Channel& channel, double length) {
    area += channel.mean_gap() * length;
    flow += channel.conductance() * length;
    slots.throat_mm = std::max(slots.throat_mm, channel.minimum);
  };
  Channel next_to_thick;
  for (std::size_t k = 0; k < kHeights; ++k) next_to_thick.add(available[k] - thick[k]);
  add(next_to_thick, 2 * plan.thick_mm);
  for (std::size_t i = 0; i < kPositions; ++i) {
    const double step = plan.thin_mm / 2 / kPositions, from_end = step * (static_cast<double>(i) + 0.5);
    Channel pore;
    for (std::size_t k = 0; k < kHeights; ++k) {
      const double cap = thick[k] > from_end ? std::sqrt(thick[k] * thick[k] - from_end * from_end) : 0;
      pore.add(available[k] - std::max(thin[k], cap));
    }
    add(pore, 4 * step);
  }
  const double period = plan.thick_mm + plan.thin_mm, between = static_cast<double>(plan.continuous) - 1;
  if (between > 0) {
    Channel bonded;
    for (const double gap : lines) bonded.add(gap);
    add(bonded, between * period);
  }
  const double section = period * (2 * plan.spacing_sc_mm + between * plan.spacing_cc_mm);
  slots.porosity = area / section;
  slots.permeability_m2 = flow / section * 1e-6;
  return slots;
}

}  // namespace lamina::segment
