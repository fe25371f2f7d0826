#include "stages/calibration/scan/inks.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "stages/calibration/scan/dashes.h"
#include "stages/calibration/scan/marks.h"
#include "stages/calibration/scan/robust.h"

namespace lamina::calibration {
namespace {

/// What is known of each line of the image from the dash on it.
struct LineReading {
  bool known = false, there = false;
  std::uint32_t swath = 0;
  double shift_mm = 0;  // across the scan, on the image
};

std::vector<LineReading> line_readings(const Chart& chart, const HeadReading& head) {
  std::vector<LineReading> lines(chart.scan_along_x ? chart.rows : chart.columns);
  for (const ChartDash& dash : chart.dashes) {
    const bool there = head.nozzle[dash.nozzle].has_value();
    const double across = there ? head.nozzle[dash.nozzle]->across.um * 1e-3 * chart.across_sign : 0;
    lines[chart.scan_along_x ? dash.box.top : dash.box.left] = {true, there, dash.swath, across};
  }
  return lines;
}

/// How much wider the lines of a bar across the scan lie than they should; nothing if one is missing or strays by `most` mm, or
/// swaths meet in it.
std::optional<double> spread_of(const std::vector<LineReading>& lines, std::uint32_t begin, std::uint32_t end, double maximum) {
  const LineReading* last = nullptr;
  double first_shift = 0;
  for (std::uint32_t i = begin; i < end; ++i) {
    const LineReading& line = lines[i];
    if (!line.known) continue;  // of another pass
    if (!line.there || (last != nullptr && last->swath != line.swath)) return std::nullopt;
    if (last != nullptr && std::abs(line.shift_mm - last->shift_mm) > maximum) return std::nullopt;
    if (last == nullptr) first_shift = line.shift_mm;
    last = &line;
  }
  return last == nullptr ? 0 : last->shift_mm - first_shift;
}

struct BarReading {
  double wide = 0, reach = 0;  // mm; wide as it would be printed without gain
  std::vector<double> profile;
};

std::vector<BarReading> see_bars(const Photo& photo, const Chart& chart, const View& view,
                                 const std::vector<LineReading>& lines, bool along) {
  const bool axis_x = along == chart.scan_along_x;  // of the width
  std::vector<BarReading> bars;
  for (const ChartBar& bar : chart.bars) {
    if (bar.along != along) continue;
    const double x = (bar.box.right - bar.box.left) * 1e-6 * chart.pixel_x_nm,
                 y = (bar.box.bottom - bar.box.top) * 1e-6 * chart.pixel_y_nm;
    const double wide = axis_x ? x : y, high = axis_x ? y : x, reach = wide / 2 + 0.45;
    const auto spread = along ? std::optional(0.0)
                              : spread_of(lines, axis_x ? bar.box.left : bar.box.top, axis_x ? bar.box.right : bar.box.bottom,
                                          0.4e-6 * (axis_x ? chart.pixel_x_nm : chart.pixel_y_nm));
    if (!spread) continue;
    bars.push_back({wide + *spread, reach, stripe(photo, view, middle_of(bar.box, chart), axis_x, reach, 0.3 * high)});
    if (bars.back().profile.size() < 20) bars.pop_back();
  }
  return bars;
}

void measure_bars(const Photo& photo, const Chart& chart, const View& view, const HeadReading& head, InkReading& reading) {
  constexpr double kWideEnough = 0.4;  // mm: the middle is free of blur
  const std::vector<LineReading> lines = line_readings(chart, head);
  double& full = reading.full;
  for (const bool along : {true, false}) {
    const std::vector<BarReading> bars = see_bars(photo, chart, view, lines, along);
    if (along) reading.bars_detected = static_cast<std::uint32_t>(bars.size());
    std::vector<double> gains;
    for (const BarReading& bar : bars) {
      // Full ink is what bars along the scan show, of which many nozzles have a part.
      if (along)
        full = std::max(full, median_of({bar.profile.begin() + static_cast<std::ptrdiff_t>(bar.profile.size() * 2 / 5),
                                         bar.profile.begin() + static_cast<std::ptrdiff_t>(bar.profile.size() * 3 / 5 + 1)}));
    }
    for (const BarReading& bar : bars) {
      const double gain = full > 0 ? 1000 * (width_of(bar.profile, bar.reach, full) - bar.wide) / 2 : 1000;
      if (bar.wide > kWideEnough && std::abs(gain) < 400) gains.push_back(gain);
    }
    (along ? reading.gain_along_um : reading.gain_across_um) = median_of(gains);
    (along ? reading.bars_along : reading.bars_across) = static_cast<std::uint32_t>(gains.size());
  }
}

void measure_wedges(const Photo& photo, const Chart& chart, const View& view, InkReading& reading) {
  std::vector<double> dark;
  for (const ChartWedge& wedge : chart.wedges) {
    const double x = (wedge.box.right - wedge.box.left) * 1e-6 * chart.pixel_x_nm,
                 y = (wedge.box.bottom - wedge.box.top) * 1e-6 * chart.pixel_y_nm;
    const auto profile = stripe(photo, view, middle_of(wedge.box, chart), true, 0.35 * x, 0.35 * y);
    double sum = 0;
    for (const double value : profile) sum += value;
    dark.push_back(profile.empty() ? 0 : sum / static_cast<double>(profile.size()));
  }
  const double full = dark.empty() ? 0 : *std::ranges::max_element(dark);
  for (std::size_t w = 0; w < dark.size() && full > 0; ++w)
    reading.wedges.emplace_back(chart.wedges[w].percent, 100 * dark[w] / full);
}

}  // namespace

double width_of(const std::vector<double>& profile, double reach, double full) {
  const std::size_t end = profile.size() / 10 + 1, last = profile.size() - 1;
  double ground = 0;
  for (std::size_t i = 0; i < end; ++i) ground += (profile[i] + profile[last - i]) / (2 * static_cast<double>(end));
  const double half = (full + ground) / 2;
  const auto crossing = [&](bool from_end) {
    const auto value = [&](std::size_t i) { return profile[from_end ? last - i : i]; };
    for (std::size_t i = 1; i <= last; ++i) {
      if (value(i) >= half) return static_cast<double>(i) - (value(i) - half) / std::max(value(i) - value(i - 1), 1e-9);
    }
    return static_cast<double>(last) / 2;
  };
  return (static_cast<double>(last) - crossing(false) - crossing(true)) * 2 * reach / static_cast<double>(last);
}

InkReading read_inks(const Photo& photo, const Chart& chart, const SheetFit& fit, const HeadReading& head) {
  InkReading reading;
  measure_bars(photo, chart, fit.view, head, reading);
  measure_wedges(photo, chart, fit.view, reading);
  return reading;
}

}  // namespace lamina::calibration
