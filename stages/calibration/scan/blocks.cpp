#include "stages/calibration/scan/blocks.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stages/calibration/robust.h"
#include "stages/calibration/scan/dashes.h"
#include "stages/calibration/scan/marks.h"

namespace lamina::calibration {
namespace {

/// What is known of each line of the image from the dash on it.
struct LineReading {
  bool known = false, there = false;
  std::uint32_t swath = 0;
  double along_um = 0, across_um = 0;  // offset of its nozzle
  double shift_mm = 0;                 // across the scan, on the image
};

/// The lines of the image that a box covers, [first, second).
std::pair<std::uint32_t, std::uint32_t> lines_in(const Chart& chart, const ChartBox& box) {
  return chart.scan_along_x ? std::pair(box.top, box.bottom) : std::pair(box.left, box.right);
}

std::vector<LineReading> line_readings(const Chart& chart, const HeadReading& head) {
  std::vector<LineReading> lines(chart.scan_along_x ? chart.rows : chart.columns);
  for (const ChartDash& dash : chart.dashes) {
    const auto& nozzle = head.nozzle[dash.nozzle];
    LineReading& line = lines[lines_in(chart, dash.box).first] = {true, nozzle.has_value(), dash.swath};
    if (!nozzle) continue;
    line.along_um = nozzle->along.um;
    line.across_um = nozzle->across.um;
    line.shift_mm = nozzle->across.um * 1e-3 * chart.across_sign;
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
    const auto [x, y] = size_of(bar.box, chart);
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
    const auto [x, y] = size_of(wedge.box, chart);
    const auto profile = stripe(photo, view, middle_of(wedge.box, chart), true, 0.35 * x, 0.35 * y);
    const double sum = std::accumulate(profile.begin(), profile.end(), 0.0);
    dark.push_back(profile.empty() ? 0 : sum / static_cast<double>(profile.size()));
  }
  const double full = dark.empty() ? 0 : *std::ranges::max_element(dark);
  for (std::size_t w = 0; w < dark.size() && full > 0; ++w)
    reading.wedges.emplace_back(chart.wedges[w].percent, 100 * dark[w] / full);
}

constexpr double kAgreeAlong = 0.25, kAgreeAcross = 1;  // pixels
constexpr std::size_t kFewestTicks = 3;                 // on a side

struct Tick {
  std::size_t vernier = 0;
  bool after = false;
  Profile profile;    // along the scan, in mm of the image
  double middle = 0;  // where it is detected in it
  double height = 0;
  double shift_mm = 0;  // of its swath, that the profile is about
};

/// In mm of the image: the width of a box along the scan, its height across it.
double width_along(const Chart& chart, const ChartBox& box) { return along_of(chart, size_of(box, chart)); }
double height_across(const Chart& chart, const ChartBox& box) { return across_of(chart, size_of(box, chart)); }

void add_ticks(const Photo& photo, const Chart& chart, const SheetFit& fit, std::size_t v, bool after,
               std::vector<Tick>& ticks) {
  const ChartVernier& vernier = chart.verniers[v];
  const std::vector<ChartBox>& boxes = after ? vernier.after : vernier.before;
  if (boxes.size() < 2) return;
  const Spot a = middle_of(boxes[0], chart), b = middle_of(boxes[1], chart);
  const double reach = 0.5 * std::abs(along_of(chart, b) - along_of(chart, a));
  const Spot shift = fit.shift[after ? vernier.swath : vernier.swath - 1];
  for (const ChartBox& box : boxes) {
    const Spot m = middle_of(box, chart), at{m.x + shift.x, m.y + shift.y};
    Tick tick{v, after, {}, 0, 0, along_of(chart, shift)};
    tick.profile.value = stripe(photo, fit.view, at, chart.scan_along_x, reach, 0.35 * height_across(chart, box));
    const std::size_t n = tick.profile.value.size();
    if (n < 9) continue;
    tick.profile.step = 2 * reach / static_cast<double>(n - 1);
    const double ground = *std::ranges::min_element(tick.profile.value);
    double sum = 0, moment = 0;
    for (std::size_t i = 0; i < n; ++i) {
      if (std::abs(tick.profile.position(i)) > 0.5 * reach + 0.5 * width_along(chart, box)) continue;
      sum += tick.profile.value[i] - ground;
      moment += (tick.profile.value[i] - ground) * tick.profile.position(i);
    }
    tick.middle = sum > 0 ? moment / sum : 0;
    tick.height = *std::ranges::max_element(tick.profile.value) - ground;
    ticks.push_back(std::move(tick));
  }
}

/// Places ticks by the shape of all.
std::vector<Tick> see_ticks(const Photo& photo, const Chart& chart, const SheetFit& fit) {
  std::vector<Tick> ticks;
  for (std::size_t v = 0; v < chart.verniers.size(); ++v) {
    for (const bool after : {false, true}) add_ticks(photo, chart, fit, v, after, ticks);
  }
  std::vector<double> heights;
  double reach = 0;
  for (const Tick& tick : ticks) {
    heights.push_back(tick.height);
    reach = std::max(reach, -tick.profile.position(0));
  }
  const double minimum = 0.5 * median_of(heights);
  std::erase_if(ticks, [&](const Tick& tick) { return tick.height < minimum; });
  for (int round = 0; round < 2; ++round) {
    Shape shape(reach, 0.01);
    for (const Tick& tick : ticks) shape.add(tick.profile, tick.middle, *std::ranges::min_element(tick.profile.value));
    shape.settle();
    for (Tick& tick : ticks) tick.middle = fit_shape(tick.profile, shape, tick.middle, 0.9 * reach, 0.3 * reach).middle;
  }
  return ticks;
}

/// The mean offset along the scan of the nozzles that print a tick.
double mean_along(const Chart& chart, const std::vector<LineReading>& lines, const ChartBox& box) {
  double sum = 0, count = 0;
  const auto [begin, end] = lines_in(chart, box);
  // Of these the stripe sees the middle seven tenths.
  const double middle = 0.5 * (begin + end), half = 0.35 * (end - begin);
  for (std::uint32_t l = begin; l < end; ++l) {
    if (!lines[l].there || std::abs(l + 0.5 - middle) > half + 0.5) continue;
    sum += lines[l].along_um;
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

std::optional<double> along_um(const Chart& chart, const std::vector<Tick>& ticks, std::size_t v,
                               const std::vector<LineReading>& lines) {
  std::array<std::vector<double>, 2> mm;
  for (const Tick& tick : ticks) {
    if (tick.vernier == v) mm[tick.after].push_back(tick.middle + tick.shift_mm);
  }
  if (std::min(mm[0].size(), mm[1].size()) < kFewestTicks) return std::nullopt;
  const ChartVernier& vernier = chart.verniers[v];
  const double step = 1000 * chart.along_sign * (settled_mean(mm[1], 0.001).mean - settled_mean(mm[0], 0.001).mean);
  return step - mean_along(chart, lines, vernier.after[0]) + mean_along(chart, lines, vernier.before[0]);
}

/// By how much a joint's block is higher than its pixels and their gain.
std::optional<double> across_um(const Photo& photo, const Chart& chart, const SheetFit& fit, const ChartBox& block,
                                std::uint32_t swath, const InkReading& inks, const std::vector<LineReading>& lines) {
  if (inks.bars_across == 0 || inks.full <= 0) return std::nullopt;
  const auto [begin, end] = lines_in(chart, block);
  // From the swath before to this one, however lines rise.
  const LineReading &before = lines[chart.across_sign > 0 ? begin : end - 1],
                    &after = lines[chart.across_sign > 0 ? end - 1 : begin];
  if (!before.there || !after.there) return std::nullopt;
  const double high = height_across(chart, block), reach = high / 2 + 0.45;
  const Spot m = middle_of(block, chart), a = fit.shift[swath - 1], b = fit.shift[swath];
  const Spot at{m.x + 0.5 * (a.x + b.x), m.y + 0.5 * (a.y + b.y)};
  const auto profile = stripe(photo, fit.view, at, !chart.scan_along_x, reach, 0.3 * width_along(chart, block));
  if (profile.size() < 20) return std::nullopt;
  const double wide = width_of(profile, reach, inks.full);
  if (wide <= 0) return std::nullopt;
  return 1000 * (wide - high) - 2 * inks.gain_across_um - after.across_um + before.across_um;
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

std::vector<JointReading> read_stitches(const Photo& photo, const Chart& chart, const SheetFit& fit, const HeadReading& head,
                                        const InkReading& inks) {
  std::vector<JointReading> stitches;
  if (chart.stitches.empty() && chart.verniers.empty()) return stitches;
  const std::vector<LineReading> lines = line_readings(chart, head);
  const std::vector<Tick> ticks = see_ticks(photo, chart, fit);
  const Spot pixel_nm{chart.pixel_x_nm, chart.pixel_y_nm};
  for (std::uint32_t s = 1; s < chart.swaths; ++s) {
    if (!head.swath[s] || !head.swath[s - 1]) continue;
    JointReading joint{s, {}, {}};
    for (std::size_t v = 0; v < chart.verniers.size(); ++v) {
      if (chart.verniers[v].swath == s) joint.along_um = along_um(chart, ticks, v, lines);
    }
    if (s <= chart.stitches.size()) joint.across_um = across_um(photo, chart, fit, chart.stitches[s - 1], s, inks, lines);
    const auto differs = [&](const std::optional<double>& um, const Measure& to, const Measure& from, double max_nm) {
      return um && to.known() && std::abs(*um - (to.um - from.um)) > 1e-3 * max_nm + std::hypot(to.within_um, from.within_um);
    };
    joint.agrees =
        !differs(joint.along_um, head.swath[s]->along, head.swath[s - 1]->along, kAgreeAlong * along_of(chart, pixel_nm)) &&
        !differs(joint.across_um, head.swath[s]->across, head.swath[s - 1]->across, kAgreeAcross * across_of(chart, pixel_nm));
    stitches.push_back(joint);
  }
  return stitches;
}

}  // namespace lamina::calibration
