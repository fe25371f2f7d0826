#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/keys.h"
#include "pipeline/plan/segment.h"
#include "pipeline/text/ranges.h"

namespace lamina::pipeline {
namespace {

Result<SegmentRange> resolve(const SegmentSettings& settings, const segment::Calibration& calibration, double bead_mm) {
  SegmentRange range;
  range.settings = settings;
  segment::Segmentation& plan = range.plan;
  const segment::RepeatedReading widths = segment::repeated_at(calibration, settings.thick_extrusion);
  const double scale = bead_mm / calibration.width_mm;  // the tables are of one bead; others are taken in proportion
  plan.rule = settings.rule;
  plan.thick_mm = settings.thick_mm;
  plan.thin_mm = settings.thin_mm;
  plan.least_end_mm = settings.least_end_mm.value_or(settings.thick_mm / 2);
  plan.continuous = settings.continuous;
  plan.thick_extrusion = settings.thick_extrusion;
  plan.thin_extrusion = settings.thin_extrusion.value_or(settings.thick_extrusion);
  plan.thick_speed = settings.thick_speed.value_or(calibration.repeated.empty() ? 100 : widths.thick_speed_percent);
  plan.thin_speed = settings.thin_speed;
  const bool measured = !calibration.repeated.empty();
  plan.thick_width_mm = settings.thick_width_mm.value_or(measured ? widths.thick_mm * scale : bead_mm);
  plan.continuous_width_mm = settings.continuous_width_mm.value_or(measured ? widths.continuous_mm * scale : bead_mm);
  const auto thin_width = [&](double extrusion, double speed) {
    if (settings.thin_width_mm) return *settings.thin_width_mm;
    if (measured && extrusion == plan.thick_extrusion && std::abs(speed - 200) < 1) return widths.thin_mm * scale;
    if (speed > 100) return segment::thin_width_at_speed(calibration, speed).value * scale;
    return segment::thin_width_at_extrusion(calibration, extrusion).value * scale;
  };
  plan.thin_width_mm = thin_width(plan.thin_extrusion, plan.thin_speed);
  const std::size_t lines = std::max(settings.thin_speed_sweep.size(), settings.thin_extrusion_sweep.size());
  for (std::size_t i = 0; i < lines; ++i) {
    const auto of = [i](const std::vector<double>& list, double all) { return list.empty() ? all : list[i % list.size()]; };
    const double extrusion = of(settings.thin_extrusion_sweep, plan.thin_extrusion),
                 speed = of(settings.thin_speed_sweep, plan.thin_speed);
    plan.sweep.push_back({extrusion, speed, thin_width(extrusion, speed)});
  }
  segment::Spacing spacing = segment::spacing_for(plan.thick_width_mm, plan.continuous_width_mm, settings.gap_mm);
  const bool own_widths = settings.thick_width_mm || settings.continuous_width_mm;
  if (const auto settled = segment::settled_spacing(calibration, settings.thick_extrusion); settled && !own_widths) {
    spacing = {settled->segmented * scale + settings.gap_mm, settled->continuous * scale + settings.gap_mm};
  }
  plan.spacing_sc_mm = settings.spacing_sc_mm.value_or(spacing.segmented);
  plan.spacing_cc_mm = settings.spacing_cc_mm.value_or(spacing.continuous);
  if (const Status status = segment::check(plan, bead_mm); !status) return status.error();
  return range;
}

/// The distances between lines, in turn from a segmented one.
std::vector<double> distances_of(const segment::Segmentation& plan, std::int32_t first) {
  const auto period = static_cast<std::int64_t>(plan.continuous) + 1;
  std::vector<double> distances;
  for (std::int64_t line = 0; line < period; ++line) {
    const std::int64_t place = line - first - floor_div(line - first, period) * period;
    distances.push_back(place == 0 || place == period - 1 ? plan.spacing_sc_mm : plan.spacing_cc_mm);
  }
  return distances;
}

/// Whether a filling leaves the distances between its lines to the segmentation.
bool leaves_distances(const FillSettings& fill) { return distance_keys(fill).empty() && fill.group == 1; }

/// Spacings of a segmentation beside distances that the filling gives itself.
Status check_spacings(const SegmentSettings& settings, const FillSettings& fill, const std::string& where) {
  if (!settings.on || leaves_distances(fill)) return {};
  const std::string_view key = settings.spacing_sc_mm   ? "spacing_sc_mm"
                               : settings.spacing_cc_mm ? "spacing_cc_mm"
                               : settings.gap_mm != 0   ? "gap_mm"
                                                        : "";
  if (key.empty()) return {};
  const auto keys = distance_keys(fill);
  return Error{Fault::kUsage, fmt::format("segment.{}: {}fill.{} says how far lines lie from each other; leave out one of them",
                                          key, where, keys.empty() ? "group" : keys.front())};
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

Result<SegmentPlan> plan_segments(const SegmentRequest& request, const segment::Calibration& calibration, FillRequest& fill) {
  SegmentPlan plan;
  auto base = resolve(request.all, calibration, fill.all.width_mm);
  if (!base && request.any()) return base.error();
  if (base) plan.base = *base;
  if (!request.any()) return plan;
  if (fill.all.pattern == infill::Pattern::kNone) fill.all.pattern = infill::Pattern::kRaster;
  const bool spaced = leaves_distances(fill.all);
  if (Status status = check_spacings(request.all, fill.all, ""); !status) return status.error();
  if (plan.base.settings.on && spaced) fill.all.distance_mm = distances_of(plan.base.plan, plan.base.settings.first);

  for (const auto& asked : request.ranges) {
    const std::string name = range_name(asked.from_mm, asked.to_mm);
    SegmentSettings settings = request.all;
    apply(segment_settings_keys(), asked.changes, settings);
    if (Status status = spaced ? Status() : check_spacings(settings, fill.all, name + ": "); !status) return status.error();
    auto range = resolve(settings, calibration, fill.all.width_mm);
    if (!range) return Error{Fault::kUsage, fmt::format("segment.range: {}: {}", name, range.error().message)};
    range->from = nm_of(asked.from_mm);
    range->to = nm_of(asked.to_mm);
    const auto filling = filling_of(asked, fill);
    if (!filling) return filling.error();
    if (spaced && distance_keys((*filling)->changes).empty()) {
      set_distances(settings.on ? distances_of(range->plan, settings.first) : std::vector{fill.all.width_mm},
                    (*filling)->changes);
    }
    plan.ranges.push_back(std::move(*range));
  }
  std::ranges::sort(plan.ranges, {}, &SegmentRange::from);
  return plan;
}

}  // namespace lamina::pipeline
