#include "stages/segment/calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <span>

namespace lamina::segment {
namespace {

struct Mark {
  double x, y;
};

/// Marks in increasing x.
Reading interpolate(std::span<const Mark> marks, double x) {
  if (marks.empty()) return {0, false};
  if (x < marks.front().x) return {marks.front().y, false};
  for (std::size_t i = 1; i < marks.size(); ++i) {
    if (x > marks[i].x) continue;
    const double share = (x - marks[i - 1].x) / (marks[i].x - marks[i - 1].x);
    return {marks[i - 1].y + share * (marks[i].y - marks[i - 1].y), true};
  }
  return {marks.back().y, x <= marks.back().x};
}

/// Marks of a table, in the order of its rows.
template <class Row>
std::vector<Mark> marks_of(const std::vector<Row>& rows, double Row::*x, double Row::*y) {
  std::vector<Mark> marks;
  for (const Row& row : rows) marks.push_back({row.*x, row.*y});
  return marks;
}

/// Of increasing speeds, from 100 % on.
std::vector<Mark> marks_by_speed(const Calibration& calibration, double at_100, double Calibration::BySpeed::*y) {
  std::vector<Mark> marks = marks_of(calibration.by_speed, &Calibration::BySpeed::percent, y);
  marks.insert(marks.begin(), {100, at_100});
  return marks;
}

}  // namespace

const Calibration& anet_a8_calibration() {
  static const Calibration calibration{
      "Di Nisio 2022, Tables 6, 7 and 11 to 15: Anet A8, PLA, nozzle 0.4 mm",
      0.4,
      0.3,
      15,
      {{125, 0.31, 1.05, 0.45},
       {150, 0.27, 2.25, 0.50},
       {175, 0.26, 3.50, 0.53},
       {200, 0.21, 4.45, 0.57},
       {225, 0.19, 5.20, 0.60},
       {250, 0.17, 5.75, 0.64},
       {275, 0.17, 6.95, 0.66},
       {300, 0.15, 7.45, 0.70},
       {325, 0.17, 8.02, 0.74},
       {350, 0.16, 8.80, 0.76},
       {375, 0.16, 9.40, 0.76},
       {400, 0.12, 9.80, 0.79}},
      {{90, 0.37}, {80, 0.33}, {70, 0.31}, {60, 0.29}, {50, 0.27}, {40, 0.24}, {30, 0.21}, {20, 0.19}, {10, 0.16}},
      {{75, 200, 100, (0.38 + 0.39 + 0.39) / 3, (0.28 + 0.28 + 0.29) / 3, 0.40},
       {100, 200, 75, (0.45 + 0.45 + 0.44) / 3, (0.31 + 0.32 + 0.31) / 3, (0.39 + 0.39 + 0.40) / 3},
       {125, 200, 50, (0.59 + 0.58 + 0.58) / 3, (0.32 + 0.32 + 0.31) / 3, (0.40 + 0.39 + 0.39) / 3}},
      {}};
  return calibration;
}

Status check(const Calibration& calibration) {
  const auto wrong = [](std::string_view table, std::size_t row, std::string_view what) {
    return Error{Fault::kUsage, fmt::format("{}: row {}: {}", table, row + 1, what)};
  };
  if (!(calibration.width_mm > 0) || !(calibration.height_mm > 0) || !(calibration.speed_mm_s > 0)) {
    return Error{Fault::kUsage, "calibration: width, height and speed have to be above 0"};
  }
  for (std::size_t i = 0; i < calibration.by_speed.size(); ++i) {
    const auto& row = calibration.by_speed[i];
    if (!(row.percent > (i == 0 ? 100 : calibration.by_speed[i - 1].percent))) {
      return wrong("by_speed", i, "speeds have to be above 100 % and to increase");
    }
    if (!(row.thin_mm > 0) || !(row.stable_mm > 0) || !(row.swell_mm > 0))
      return wrong("by_speed", i, "lengths have to be above 0");
  }
  for (std::size_t i = 0; i < calibration.by_extrusion.size(); ++i) {
    const auto& row = calibration.by_extrusion[i];
    if (!(row.percent < (i == 0 ? 100 : calibration.by_extrusion[i - 1].percent)) || !(row.percent > 0)) {
      return wrong("by_extrusion", i, "extrusions have to be below 100 % and to decrease");
    }
    if (!(row.thin_mm > 0)) return wrong("by_extrusion", i, "widths have to be above 0");
  }
  for (std::size_t i = 0; i < calibration.repeated.size(); ++i) {
    const auto& row = calibration.repeated[i];
    if (!(row.extrusion_percent > (i == 0 ? 0 : calibration.repeated[i - 1].extrusion_percent))) {
      return wrong("repeated", i, "extrusions have to be above 0 and to increase");
    }
    if (!(row.thin_speed_percent > 0) || !(row.thick_speed_percent > 0) || !(row.thick_mm > 0) || !(row.thin_mm > 0) ||
        !(row.continuous_mm > 0)) {
      return wrong("repeated", i, "speeds and widths have to be above 0");
    }
  }
  for (std::size_t i = 0; i < calibration.spacing.size(); ++i) {
    const auto& row = calibration.spacing[i];
    if (!(row.extrusion_percent > (i == 0 ? 0 : calibration.spacing[i - 1].extrusion_percent))) {
      return wrong("spacing", i, "extrusions have to be above 0 and to increase");
    }
    if (!(row.segmented_mm > 0) || !(row.continuous_mm > 0)) return wrong("spacing", i, "distances have to be above 0");
  }
  return {};
}

Reading thin_width_at_speed(const Calibration& calibration, double percent) {
  return interpolate(marks_by_speed(calibration, calibration.width_mm, &Calibration::BySpeed::thin_mm), percent);
}

Reading stable_distance(const Calibration& calibration, double percent) {
  return interpolate(marks_by_speed(calibration, 0, &Calibration::BySpeed::stable_mm), percent);
}

Reading thin_width_at_extrusion(const Calibration& calibration, double percent) {
  using Row = Calibration::ByExtrusion;
  std::vector<Mark> marks = marks_of(calibration.by_extrusion, &Row::percent, &Row::thin_mm);
  std::ranges::reverse(marks);
  marks.push_back({100, calibration.width_mm});
  return interpolate(marks, percent);
}

RepeatedReading repeated_at(const Calibration& calibration, double extrusion_percent) {
  using Row = Calibration::Repeated;
  const auto at = [&](double Row::*value) {
    return interpolate(marks_of(calibration.repeated, &Row::extrusion_percent, value), extrusion_percent);
  };
  const Reading speed = at(&Row::thick_speed_percent);
  return {speed.value, at(&Row::thick_mm).value, at(&Row::thin_mm).value, at(&Row::continuous_mm).value, speed.inside};
}

std::optional<Spacing> settled_spacing(const Calibration& calibration, double extrusion_percent) {
  using Row = Calibration::Spaced;
  if (calibration.spacing.empty()) return std::nullopt;
  const auto at = [&](double Row::*value) {
    return interpolate(marks_of(calibration.spacing, &Row::extrusion_percent, value), extrusion_percent).value;
  };
  return Spacing{at(&Row::segmented_mm), at(&Row::continuous_mm)};
}

Spacing spacing_for(double thick_mm, double continuous_mm, double gap_mm) {
  return {(thick_mm + continuous_mm) / 2 + gap_mm, continuous_mm + gap_mm};
}

double published_spacing(double thick_mm, double set_width_mm) {
  const auto half_up = [](double value) { return std::floor(value * 100 + 0.5 + 1e-9) / 100; };
  return half_up((half_up(thick_mm) + set_width_mm) / 2);
}

}  // namespace lamina::segment
