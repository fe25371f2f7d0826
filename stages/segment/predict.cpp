#include "stages/segment/predict.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "stages/segment/pore_geometry.h"

namespace lamina::segment {
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
  if (!positive(s.thin_mm)) return wrong("thin_mm", fmt::format("{} mm; a thin stretch has to be longer than 0", s.thin_mm));
  if (!positive(s.thick_mm))
    return wrong("thick_mm", fmt::format("{} mm; a thick stretch has to be longer than 0", s.thick_mm));
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
                 fmt::format("{} mm is below the {:.3f} mm at which even thin stretches touch their neighbours and "
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
    return {{"pores", fmt::format("segment: thin stretches differ from line to line ({} kinds): a test piece to be measured",
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
    warn("segment.thin_speed_percent: not above 100 % and no less extrusion: thin stretches will not be thin");
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
        fmt::format("segment.spacing_sc_mm: thick stretches and continuous lines will be {:.3f} mm apart and not bond; "
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
