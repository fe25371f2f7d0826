#include "stages/segment/resolve.h"

#include <algorithm>
#include <cmath>

namespace lamina::segment {

Result<Segmentation> resolve(const SegmentSettings& settings, const Calibration& calibration, double bead_mm) {
  Segmentation plan;
  const RepeatedReading widths = repeated_at(calibration, settings.thick_extrusion);
  const double scale = bead_mm / calibration.width_mm;  // the tables are of one bead; others are taken in proportion
  plan.rule = settings.rule;
  plan.thick_mm = settings.thick_mm;
  plan.thin_mm = settings.thin_mm;
  plan.min_end_mm = settings.min_end_mm.value_or(settings.thick_mm / 2);
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
    if (speed > 100) return thin_width_at_speed(calibration, speed).value * scale;
    return thin_width_at_extrusion(calibration, extrusion).value * scale;
  };
  plan.thin_width_mm = thin_width(plan.thin_extrusion, plan.thin_speed);
  const std::size_t lines = std::max(settings.thin_speed_sweep.size(), settings.thin_extrusion_sweep.size());
  for (std::size_t i = 0; i < lines; ++i) {
    const auto of = [i](const std::vector<double>& list, double all) { return list.empty() ? all : list[i % list.size()]; };
    const double extrusion = of(settings.thin_extrusion_sweep, plan.thin_extrusion),
                 speed = of(settings.thin_speed_sweep, plan.thin_speed);
    plan.sweep.push_back({extrusion, speed, thin_width(extrusion, speed)});
  }
  Spacing spacing = spacing_for(plan.thick_width_mm, plan.continuous_width_mm, settings.gap_mm);
  const bool own_widths = settings.thick_width_mm || settings.continuous_width_mm;
  if (const auto settled = settled_spacing(calibration, settings.thick_extrusion); settled && !own_widths) {
    spacing = {settled->segmented * scale + settings.gap_mm, settled->continuous * scale + settings.gap_mm};
  }
  plan.spacing_sc_mm = settings.spacing_sc_mm.value_or(spacing.segmented);
  plan.spacing_cc_mm = settings.spacing_cc_mm.value_or(spacing.continuous);
  if (const Status status = check(plan, bead_mm); !status) return status.error();
  return plan;
}

std::vector<double> line_distances(const Segmentation& plan, std::int32_t first) {
  const auto period = static_cast<std::int64_t>(plan.continuous) + 1;
  std::vector<double> distances;
  for (std::int64_t line = 0; line < period; ++line) {
    const std::int64_t position = line - first - floor_div(line - first, period) * period;
    distances.push_back(position == 0 || position == period - 1 ? plan.spacing_sc_mm : plan.spacing_cc_mm);
  }
  return distances;
}

}  // namespace lamina::segment
