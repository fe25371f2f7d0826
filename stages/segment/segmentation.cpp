#include "stages/segment/segmentation.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

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

namespace {

double group_distance(const Segmentation& s) {
  return 2 * s.spacing_sc_mm + (static_cast<double>(s.continuous) - 1) * s.spacing_cc_mm;
}

PoreSize planned_pore(const Segmentation& s) {
  return pore_geometry({s.thick_width_mm, s.thin_width_mm, s.continuous_width_mm}, s.thin_mm, s.spacing_sc_mm);
}

}  // namespace

Status check(const Segmentation& s, double bead_width_mm) {
  const auto wrong = [](std::string_view key, const std::string& what) {
    return Error{Fault::kUsage, fmt::format("segment.{}: {}", key, what)};
  };
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  if (!positive(s.thin_mm)) return wrong("thin_mm", fmt::format("{} mm; a thin segment has to be longer than 0", s.thin_mm));
  if (!positive(s.thick_mm))
    return wrong("thick_mm", fmt::format("{} mm; a thick segment has to be longer than 0", s.thick_mm));
  for (const auto& [key, value] : {std::pair{"thick_speed_percent", s.thick_speed}, {"thin_speed_percent", s.thin_speed}}) {
    if (!positive(value)) return wrong(key, fmt::format("{} %; a speed has to be above 0", value));
  }
  for (const auto& [key, value] :
       {std::pair{"thick_extrusion_percent", s.thick_extrusion}, {"thin_extrusion_percent", s.thin_extrusion}}) {
    if (!positive(value)) return wrong(key, fmt::format("{} %; an extrusion has to be above 0", value));
  }
  for (std::size_t i = 0; i < s.sweep.size(); ++i) {
    if (!positive(s.sweep[i].speed))
      return wrong("thin_speed_sweep", fmt::format("line {}: {} %; a speed has to be above 0", i + 1, s.sweep[i].speed));
    if (!positive(s.sweep[i].extrusion)) {
      return wrong("thin_extrusion_sweep",
                   fmt::format("line {}: {} %; an extrusion has to be above 0", i + 1, s.sweep[i].extrusion));
    }
  }
  if (s.continuous < 1) return wrong("continuous_lines", "0; give 1 or more, lines between two segmented ones");
  // A bead that is squeezed more than this has no room: its neighbour's centre lies inside of it.
  const double minimum = (s.thin_width_mm + s.continuous_width_mm) / 2;
  if (!positive(s.spacing_sc_mm) || s.spacing_sc_mm < minimum - 1e-9) {
    return wrong("spacing_sc_mm",
                 fmt::format("{} mm is below the {:.3f} mm at which even thin segments touch their neighbours and "
                             "no pore is left; give more",
                             s.spacing_sc_mm, minimum));
  }
  if (s.continuous > 1 && (!positive(s.spacing_cc_mm) || s.spacing_cc_mm < bead_width_mm / 2)) {
    return wrong("spacing_cc_mm",
                 fmt::format("{} mm is below half of the bead of {} mm; give more", s.spacing_cc_mm, bead_width_mm));
  }
  return {};
}

std::vector<Warning> warnings(const Segmentation& s, const Calibration& calibration) {
  std::vector<Warning> found;
  const auto warn = [&](std::string text) { found.push_back({"pores", std::move(text)}); };
  if (!s.sweep.empty())
    return {{"pores", fmt::format("segment: thin segments differ from line to line ({} kinds): a test piece to be measured",
                                  s.sweep.size())}};
  if (s.thin_speed > 100 && !calibration.by_speed.empty()) {
    const Reading stable = stable_distance(calibration, s.thin_speed);
    if (s.thin_mm > stable.value) {
      warn(fmt::format(
          "segment.thin_mm: {} mm is longer than the {:.2f} mm after which a bead at {} % of the speed is as wide as before: "
          "pores close towards their ends; make it at most {:.2f} mm",
          s.thin_mm, stable.value, s.thin_speed, stable.value));
    }
    if (!stable.inside) {
      warn(
          fmt::format("segment.thin_speed_percent: {} % is outside of what was measured (100 to {} %); the nearest "
                      "value is taken",
                      s.thin_speed, calibration.by_speed.back().percent));
    }
  }
  if (s.thin_speed <= 100 && s.thin_extrusion >= 100) {
    warn("segment.thin_speed_percent: not above 100 % and no less extrusion: thin segments will not be thin");
  }
  if (s.thick_extrusion != s.thin_extrusion) {
    warn(
        "segment.thin_extrusion_percent: differs from the thick one; extrusion follows with a delay of about 1 mm "
        "and more, so keep it the same along the line and change the speed");
  }
  if (!calibration.repeated.empty()) {
    const RepeatedReading reading = repeated_at(calibration, s.thick_extrusion);
    if (!reading.inside) {
      warn(fmt::format(
          "segment.thick_extrusion_percent: {} % is outside of what was measured ({} to {} %); the nearest "
          "value is taken",
          s.thick_extrusion, calibration.repeated.front().extrusion_percent, calibration.repeated.back().extrusion_percent));
    } else if (std::abs(reading.thick_speed_percent - s.thick_speed) > 0.5) {
      warn(fmt::format("segment.thick_speed_percent: {} %; at {} % extrusion widths stay the same along the part at {:.4g} %",
                       s.thick_speed, s.thick_extrusion, reading.thick_speed_percent));
    }
  }
  const PoreSize pore = planned_pore(s);
  const double gap = pore.gap_mm;
  if (gap > kBondGap) {
    warn(
        fmt::format("segment.spacing_sc_mm: thick segments and continuous lines will be {:.3f} mm apart and not bond; "
                    "give {:.3f} mm",
                    gap, s.spacing_sc_mm - gap));
  }
  if (pore.length_mm <= 0) {
    warn(
        fmt::format("segment.thin_mm: {} mm is not longer than a thick bead is wide ({:.2f} mm): its round ends meet and "
                    "close the pore; give more",
                    s.thin_mm, s.thick_width_mm));
  }
  return found;
}

Pores predict_pores(const Segmentation& s) {
  Pores pores{};
  const PoreSize size = planned_pore(s);
  pores.length_mm = size.length_mm;
  pores.width_mm = size.width_mm;
  pores.aspect = pores.length_mm > 0 ? pores.width_mm / pores.length_mm : 0;
  pores.density_mm2 = 2 / ((s.thin_mm + s.thick_mm) * group_distance(s));
  return pores;
}

}  // namespace lamina::segment
