#include "stages/segment/design/limits.h"

#include <algorithm>
#include <cmath>

#include "stages/geometry/bead_section.h"
#include "stages/segment/resolve.h"

namespace lamina::segment {
namespace {

constexpr double kThinSpeed = 200;  // %: that of repeated stretches
constexpr double kReached = 0.77;   // of a speed; a stretch that reaches less than 0.75 is warned of
constexpr double kMinPoreLength = 0.3, kMinPore = 0.03;
constexpr Interval kThick{1.0, 2.4}, kGap{-0.02, 0.0195};
constexpr double kMinThin = 1.0;
// Di Nisio 2022, Tables 7 and 8: lengths, and what the spacings leave between the widths of Tables 13 to 15.
constexpr Interval kMeasuredThick{1.5, 1.5}, kMeasuredThin{1.5, 2.0}, kMeasuredGap{0, 0.01};

double rounded(double value, double steps) { return std::round(value * steps) / steps; }

}  // namespace

Result<DesignLimits> DesignLimits::of(const Extruder& machine, const Calibration& calibration) {
  if (calibration.repeated.empty())
    return Error{Fault::kUsage, "its calibration has no widths of repeated stretches; measure them with lamina calibrate"};
  for (const Calibration::Repeated& row : calibration.repeated) {
    if (std::abs(row.thin_speed_percent - kThinSpeed) > 0.5)
      return Error{Fault::kUsage, "its calibration has widths of repeated stretches at other speeds than 200 %"};
  }
  DesignLimits limits;
  limits.calibration_ = &calibration;
  limits.extrusion_ = {calibration.repeated.front().extrusion_percent, calibration.repeated.back().extrusion_percent};
  const auto& material = machine.material;
  const double full = bead_area(calibration.width_mm, calibration.height_mm, material.shape()) * material.flow;
  limits.continuous_mm_ = bead_width(full, calibration.height_mm,
                                     material.shape() == BeadShape::kEllipse ? BeadShape::kEllipse : BeadShape::kStadium);
  limits.speed_mm_s_ = calibration.speed_mm_s;
  limits.acceleration_ = machine.speed.acceleration_mm_s2;
  limits.max_thin_ = calibration.by_speed.empty() ? 2.0 : stable_distance(calibration, kThinSpeed).value / 2;
  for (const double extrusion : {limits.extrusion_.minimum, limits.extrusion_.maximum}) {
    const Choice minimum = limits.nearest({1, extrusion, kThick.minimum, 0, 0});
    if (minimum.thin_mm > limits.max_thin_)
      return Error{Fault::kUsage, "it accelerates too slowly: thin stretches end before they have reached their speed"};
  }
  return limits;
}

Choice DesignLimits::nearest(Choice choice) const {
  choice.continuous = std::clamp<std::uint32_t>(choice.continuous, 1, kMaxContinuous);
  choice.extrusion = extrusion_.near(choice.extrusion);
  const RepeatedReading widths = repeated_at(*calibration_, choice.extrusion);
  // From the thick speed up and down again: v^2 = v0^2 + a s.
  const double fast = kReached * kThinSpeed / 100 * speed_mm_s_, slow = widths.thick_speed_percent / 100 * speed_mm_s_;
  const double starts = acceleration_ > 0 ? (fast * fast - slow * slow) / acceleration_ : 0;
  const double min_thin = std::max({kMinThin, starts, widths.thick_mm + kMinPoreLength});
  choice.thin_mm = std::max(std::min(choice.thin_mm, max_thin_), min_thin);
  choice.thick_mm = kThick.near(choice.thick_mm);
  choice.gap_mm = kGap.near(std::max(choice.gap_mm, kMinPore - (widths.thick_mm - widths.thin_mm) / 2));
  return choice;
}

SegmentSettings DesignLimits::settings_of(const Choice& choice) const {
  SegmentSettings settings;
  settings.on = true;
  settings.continuous = choice.continuous;
  settings.thick_extrusion = rounded(choice.extrusion, 10);
  settings.thick_mm = rounded(choice.thick_mm, 1000);
  settings.thin_mm = rounded(choice.thin_mm, 1000);
  settings.thin_speed = kThinSpeed;
  const RepeatedReading widths = repeated_at(*calibration_, settings.thick_extrusion);
  settings.thick_speed = rounded(widths.thick_speed_percent, 10);
  const Spacing spacing = spacing_for(widths.thick_mm, widths.continuous_mm, choice.gap_mm);
  settings.spacing_sc_mm = rounded(spacing.segmented, 10'000);
  settings.spacing_cc_mm = rounded(widths.continuous_mm, 10'000);
  return settings;
}

Result<Segmentation> DesignLimits::plan_of(const Choice& choice) const { return plan_of(settings_of(choice)); }

Result<Segmentation> DesignLimits::plan_of(const SegmentSettings& settings) const {
  return resolve(settings, *calibration_, calibration_->width_mm);
}

Segmentation DesignLimits::deposited(Segmentation plan) const {
  plan.continuous_width_mm = continuous_mm_;
  return plan;
}

std::array<double, 4> DesignLimits::beyond(const Choice& choice) const {
  const auto outside = [](const Interval& measured, double value, double far) { return (value - measured.near(value)) / far; };
  double row = INFINITY;
  for (const Calibration::Repeated& measured : calibration_->repeated)
    row = std::min(row, std::abs(choice.extrusion - measured.extrusion_percent));
  return {row / 25, outside(kMeasuredThick, choice.thick_mm, 0.5), outside(kMeasuredThin, choice.thin_mm, 0.5),
          outside(kMeasuredGap, choice.gap_mm, 0.01)};
}

}  // namespace lamina::segment
