#include "pipeline/plan/layer_cut.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/infill/spacing.h"

namespace lamina::pipeline {
namespace {

/// Where a filling turned by 90 degrees has its first line, nm across it. errors  of infill::first_position
Result<double> first_line_across(const infill::FillParameters& filling, MicroDegrees angle, const Layer& layer,
                                 const Box& part) {
  infill::FillParameters turned = filling;
  turned.angle_base = (angle + kTurn / 4) % (kTurn / 2);
  turned.angle_step = 0;
  const auto [low, high] = segment::reach(part, segment::across(turned.angle_base));
  const auto position = infill::first_position(
      turned, {layer, part}, {std::llround(low), std::llround(high - low), std::llround(low), std::llround(high)});
  if (!position) return position.error();
  return low + static_cast<double>(*position);
}

}  // namespace

Result<segment::LayerCut> layer_cut(const SegmentRange& range, const infill::FillParameters& filling, const Layer& layer,
                                    const Box& part) {
  const SegmentSettings& settings = range.settings;
  segment::CutPosition position;
  position.on = settings.on;
  if (!position.on) return segment::LayerCut();
  position.first = settings.first;
  position.one_direction = settings.one_direction;
  position.angle = infill::layer_angle(filling, layer.index) % (kTurn / 2);
  if (settings.across) {
    const auto first_line = first_line_across(filling, position.angle, layer, part);
    if (!first_line) return first_line.error();
    position.first_line = *first_line;
  }
  if (!settings.shift_mm.empty()) position.shift_mm = settings.shift_mm[layer.index % settings.shift_mm.size()];
  return segment::layer_cut(range.plan, position, part);
}

Status check_thin_intervals(const SegmentPlan& segments, const Sections& plan) {
  // No straight line is longer than the parts are across; closed curves are.
  const double across =
      mm(std::llround(std::hypot(static_cast<double>(plan.bounds().width()), static_cast<double>(plan.bounds().depth()))));
  const auto too_long = [&](const SegmentRange& range) { return range.settings.on && range.plan.thin_mm >= across; };
  const auto longer = [&](const SegmentRange& range, const std::string& where) {
    return Error{
        Fault::kUsage,
        fmt::format("segment.thin_mm: {}{} mm is longer than any line in the parts, which are {:.3f} mm across; give less",
                    where, range.plan.thin_mm, across)};
  };
  if (!too_long(segments.base) && std::ranges::none_of(segments.ranges, too_long)) return {};
  for (const Sections::Area& area : plan.areas()) {
    for (const ScheduledLayer& scheduled : plan.layers()) {
      const infill::Pattern pattern = plan.filling(area, scheduled.own()).pattern;
      if (pattern == infill::Pattern::kContour || pattern == infill::Pattern::kContourRaster) return {};
    }
  }
  if (too_long(segments.base)) return longer(segments.base, "");
  for (const SegmentRange& range : segments.ranges) {
    if (too_long(range)) return longer(range, fmt::format("{:g} to {:g} mm: ", mm(range.from), mm(range.to)));
  }
  return {};
}

}  // namespace lamina::pipeline
