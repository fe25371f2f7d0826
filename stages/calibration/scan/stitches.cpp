#include "stages/calibration/scan/stitches.h"

#include <algorithm>
#include <cmath>

#include "stages/calibration/scan/dashes.h"
#include "stages/calibration/scan/marks.h"
#include "stages/calibration/scan/robust.h"

namespace lamina::calibration {
namespace {

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

/// In mm of the image, along the scan: the width of a tick, and from one to the next.
double width_along(const Chart& chart, const ChartBox& box) {
  return chart.scan_along_x ? (box.right - box.left) * 1e-6 * chart.pixel_x_nm
                            : (box.bottom - box.top) * 1e-6 * chart.pixel_y_nm;
}
double height_across(const Chart& chart, const ChartBox& box) {
  return chart.scan_along_x ? (box.bottom - box.top) * 1e-6 * chart.pixel_y_nm
                            : (box.right - box.left) * 1e-6 * chart.pixel_x_nm;
}
double along_of(const Chart& chart, const Spot& mm) { return chart.scan_along_x ? mm.x : mm.y; }

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

/// The nozzle of each line of the image, by the dash on it.
struct LineOffset {
  bool known = false, there = false;
  double along_um = 0, across_um = 0;
};
std::vector<LineOffset> line_offsets(const Chart& chart, const HeadReading& head) {
  std::vector<LineOffset> lines(chart.scan_along_x ? chart.rows : chart.columns);
  for (const ChartDash& dash : chart.dashes) {
    const auto& nozzle = head.nozzle[dash.nozzle];
    LineOffset& line = lines[chart.scan_along_x ? dash.box.top : dash.box.left];
    line.known = true;
    line.there = nozzle.has_value();
    if (nozzle) line = {true, true, nozzle->along.um, nozzle->across.um};
  }
  return lines;
}

/// The mean offset along the scan of the nozzles that print a tick.
double mean_along(const Chart& chart, const std::vector<LineOffset>& lines, const ChartBox& box) {
  double sum = 0, count = 0;
  const std::uint32_t begin = chart.scan_along_x ? box.top : box.left, end = chart.scan_along_x ? box.bottom : box.right;
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
                               const std::vector<LineOffset>& lines) {
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
                                std::uint32_t swath, const InkReading& inks, const std::vector<LineOffset>& lines) {
  if (inks.bars_across == 0 || inks.full <= 0) return std::nullopt;
  const std::uint32_t begin = chart.scan_along_x ? block.top : block.left,
                      last = (chart.scan_along_x ? block.bottom : block.right) - 1;
  // From the swath before to this one, however lines rise.
  const LineOffset &before = chart.across_sign > 0 ? lines[begin] : lines[last],
                   &after = chart.across_sign > 0 ? lines[last] : lines[begin];
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

std::vector<JointReading> read_stitches(const Photo& photo, const Chart& chart, const SheetFit& fit, const HeadReading& head,
                                        const InkReading& inks) {
  std::vector<JointReading> stitches;
  if (chart.stitches.empty() && chart.verniers.empty()) return stitches;
  const std::vector<LineOffset> lines = line_offsets(chart, head);
  const std::vector<Tick> ticks = see_ticks(photo, chart, fit);
  const double along_nm = chart.scan_along_x ? chart.pixel_x_nm : chart.pixel_y_nm,
               across_nm = chart.scan_along_x ? chart.pixel_y_nm : chart.pixel_x_nm;
  for (std::uint32_t s = 1; s < chart.swaths; ++s) {
    if (!head.swath[s] || !head.swath[s - 1]) continue;
    JointReading joint{s, {}, {}};
    for (std::size_t v = 0; v < chart.verniers.size(); ++v) {
      if (chart.verniers[v].swath == s) joint.along_um = along_um(chart, ticks, v, lines);
    }
    if (s <= chart.stitches.size()) joint.across_um = across_um(photo, chart, fit, chart.stitches[s - 1], s, inks, lines);
    const auto differs = [&](const std::optional<double>& um, const Measure& to, const Measure& from, double max_nm) {
      return um && to.reported && from.reported && std::abs(*um - (to.um - from.um)) > 1e-3 * max_nm;
    };
    joint.agrees = !differs(joint.along_um, head.swath[s]->along, head.swath[s - 1]->along, kAgreeAlong * along_nm) &&
                   !differs(joint.across_um, head.swath[s]->across, head.swath[s - 1]->across, kAgreeAcross * across_nm);
    stitches.push_back(joint);
  }
  return stitches;
}

}  // namespace lamina::calibration
