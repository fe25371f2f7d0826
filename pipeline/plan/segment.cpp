#include "pipeline/plan/segment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/keys.h"
#include "pipeline/machine/profiles.h"
#include "stages/infill/layout.h"
#include "stages/segment/segmentation.h"
#include "stages/support/text/number_text.h"

namespace lamina::pipeline {
namespace {

/// Whether the segmentation decides the line distances of a filling.
bool leaves_distances(const FillSettings& fill) { return distance_keys(fill).empty() && fill.group == 1; }

/// Refuses spacings of a segmentation if the filling sets its own line distances.
Status check_spacings(const SegmentSettings& settings, const FillSettings& fill, const std::string& where) {
  if (!settings.on || leaves_distances(fill)) return {};
  const std::string_view key = settings.spacing_sc_mm   ? "spacing_sc_mm"
                               : settings.spacing_cc_mm ? "spacing_cc_mm"
                               : settings.gap_mm != 0   ? "gap_mm"
                                                        : "";
  if (key.empty()) return {};
  const auto keys = distance_keys(fill);
  return Error{Fault::kUsage, fmt::format("segment.{}: {}fill.{} sets the line spacing as well; leave out one of them", key,
                                          where, keys.empty() ? "group" : keys.front())};
}

/// The filling between the same heights as a segmentation, or a new one without changes.
/// errors  kUsage: one that overlaps it in part
Result<FillRange*> filling_of(const Range<SegmentSettings>& range, FillRequest& fill) {
  FillRange* same = nullptr;
  for (FillRange& filling : fill.ranges) {
    if (nm_of(filling.from_mm) == nm_of(range.from_mm) && nm_of(filling.to_mm) == nm_of(range.to_mm)) {
      same = &filling;
    } else if (filling.from_mm < range.to_mm && range.from_mm < filling.to_mm) {
      return Error{Fault::kUsage,
                   fmt::format("segment.range: {} overlaps {} of fill.range in part; give both the same ends",
                               range_name(range.from_mm, range.to_mm), range_name(filling.from_mm, filling.to_mm))};
    }
  }
  if (same != nullptr) return same;
  fill.ranges.push_back({range.from_mm, range.to_mm, {}});
  return &fill.ranges.back();
}

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

const SegmentRange& SegmentPlan::at(std::int64_t height) const {
  for (const SegmentRange& range : ranges) {
    if (range.from <= height && height < range.to) return range;
  }
  return base;
}

bool SegmentPlan::any() const {
  return base.settings.on || std::ranges::any_of(ranges, [](const SegmentRange& range) { return range.settings.on; });
}

bool SegmentPlan::crosses() const {
  const auto does = [](const SegmentRange& range) { return range.settings.on && range.settings.across; };
  return does(base) || std::ranges::any_of(ranges, does);
}

std::vector<std::pair<std::string, const SegmentRange*>> SegmentPlan::segmented() const {
  std::vector<std::pair<std::string, const SegmentRange*>> all;
  if (base.settings.on) all.emplace_back("", &base);
  for (const SegmentRange& range : ranges) {
    if (range.settings.on)
      all.emplace_back(fmt::format("{} to {} mm", number_text(mm(range.from)), number_text(mm(range.to))), &range);
  }
  return all;
}

Result<SegmentPlan> plan_segments(const SegmentRequest& request, const segment::Calibration& calibration, FillRequest& fill) {
  SegmentPlan plan;
  const auto base = segment::resolve(request.all, calibration, fill.all.width_mm);
  if (!base && request.any()) return base.error();
  if (base) plan.base = {.settings = request.all, .plan = *base};
  if (!request.any()) return plan;
  if (fill.all.density_percent) {
    return Error{Fault::kUsage,
                 "fill.density_percent (--density): segmented lines have distances of their own; leave out one of the two"};
  }
  if (fill.all.pattern == infill::Pattern::kNone) fill.all.pattern = infill::Pattern::kRaster;
  const bool spaced = leaves_distances(fill.all);
  if (Status status = check_spacings(request.all, fill.all, ""); !status) return status.error();
  if (plan.base.settings.on && spaced) fill.all.distance_mm = segment::line_distances(*base, request.all.first);

  for (const auto& requested : request.ranges) {
    const std::string name = range_name(requested.from_mm, requested.to_mm);
    SegmentSettings settings = request.all;
    apply(segment_settings_keys(), requested.changes, settings);
    if (Status status = spaced ? Status() : check_spacings(settings, fill.all, name + ": "); !status) return status.error();
    const auto resolved = segment::resolve(settings, calibration, fill.all.width_mm);
    if (!resolved) return Error{Fault::kUsage, fmt::format("segment.range: {}: {}", name, resolved.error().message)};
    const auto filling = filling_of(requested, fill);
    if (!filling) return filling.error();
    if (spaced && distance_keys((*filling)->changes).empty()) {
      set_distances(settings.on ? segment::line_distances(*resolved, settings.first) : std::vector{fill.all.width_mm},
                    (*filling)->changes);
    }
    plan.ranges.push_back({nm_of(requested.from_mm), nm_of(requested.to_mm), settings, *resolved});
  }
  std::ranges::sort(plan.ranges, {}, &SegmentRange::from);
  return plan;
}

void warn_of_segments(const SegmentPlan& segments, const ExtruderProfile& profile, bool fills, std::vector<Warning>& warnings) {
  if (!fills) {
    warnings.push_back({"no-bead", "no walls and no filling are requested; give --walls, --fill or both"});
  }
  for (const auto& [heights, range] : segments.segmented()) {
    for (Warning& warning : segment::warnings(range->plan, profile.calibration)) {
      if (!heights.empty()) warning.text.insert(0, heights + ": ");
      warnings.push_back(std::move(warning));
    }
  }
  if (!segments.any()) return;
  if (auto warning = calibration_warning(profile)) warnings.push_back(std::move(*warning));
}

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
