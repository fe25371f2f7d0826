#include "stages/segment/cut.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::segment {

std::array<double, 2> direction(MicroDegrees angle) {
  angle %= kTurn / 2;
  if (angle == 0) return {1, 0};
  if (angle == kTurn / 4) return {0, 1};
  const double radians = static_cast<double>(angle) * 1e-6 * std::numbers::pi / 180;
  return {std::cos(radians), std::sin(radians)};
}

std::array<double, 2> across(MicroDegrees angle) {
  const auto [x, y] = direction(angle);
  return {-y, x};
}

std::array<double, 2> reach(const Box& part, const std::array<double, 2>& along) {
  std::array<double, 2> ends{INFINITY, -INFINITY};
  for (const Nm px : {part.lo.x, part.hi.x}) {
    for (const Nm py : {part.lo.y, part.hi.y}) {
      const double position = along[0] * px + along[1] * py;
      ends = {std::min(ends[0], position), std::max(ends[1], position)};
    }
  }
  return ends;
}

LayerCut layer_cut(const Segmentation& plan, const CutPosition& position, const Box& part) {
  LayerCut cut;
  cut.on = position.on;
  if (!cut.on) return cut;
  const auto along = direction(position.angle);
  cut.along_x = along[0];
  cut.along_y = along[1];
  cut.continuous = plan.continuous;
  cut.first = position.first;
  cut.one_direction = position.one_direction;
  cut.line = {plan.rule, nm_of(plan.thin_mm), nm_of(plan.thick_mm), 0, nm_of(plan.min_end_mm)};
  cut.line.origin = std::llround(reach(part, along)[0]);
  if (position.first_line) {
    const auto other = across(position.angle + kTurn / 4);
    const double centre = *position.first_line * (other[0] * along[0] + other[1] * along[1]);
    cut.line.origin = std::llround(centre) - cut.line.thin / 2;
  }
  cut.shift = nm_of(position.shift_mm);
  cut.line.origin += cut.shift;
  return cut;
}

Status check_interval_count(const Segmentation& plan, const LayerCut& cut, const ToolpathsView& paths, std::uint32_t layer) {
  constexpr double kMaxIntervals = 1e7;
  if (!cut.on) return {};
  double length = 0;  // nm of segmented lines
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      if (cut.segments(paths.kind[i], paths.line[i])) length += expand_detail::distance(paths.point[i], paths.point[i + 1]);
    }
  }
  if (2 * length / static_cast<double>(kNmPerMm) <= kMaxIntervals * (plan.thick_mm + plan.thin_mm)) return {};
  return Error{Fault::kUsage,
               fmt::format("layer {}: lines of {:.0f} mm come to more than 10000000 thick and thin segments; give a "
                           "longer segment.thick_mm or thin_mm",
                           layer, length * 1e-6)};
}

}  // namespace lamina::segment
