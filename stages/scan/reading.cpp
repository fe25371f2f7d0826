#include "stages/scan/reading.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "stages/scan/marks.h"

namespace lamina::scan {
namespace {

double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

/// The mean without what lies far from the median.
double settled_mean(const std::vector<double>& values) {
  const double middle = median_of(values);
  std::vector<double> distances;
  for (const double value : values) distances.push_back(std::abs(value - middle));
  const double reach = 4 * std::max(median_of(distances), 0.005);  // mm
  double sum = 0, count = 0;
  for (const double value : values) {
    if (std::abs(value - middle) > reach) continue;
    sum += value;
    ++count;
  }
  return count > 0 ? sum / count : middle;
}

/// Whether a swath was printed at all: a fifth of its dashes are there.
std::vector<bool> printed_swaths(const Chart& chart, const std::vector<DashSeen>& seen) {
  std::vector<std::uint32_t> all(chart.swaths, 0), there(chart.swaths, 0);
  for (std::size_t d = 0; d < seen.size(); ++d) {
    if (seen[d].hidden) continue;
    ++all[chart.dashes[d].swath];
    there[chart.dashes[d].swath] += seen[d].there;
  }
  std::vector<bool> printed(chart.swaths);
  for (std::uint32_t s = 0; s < chart.swaths; ++s) printed[s] = there[s] * 5 > all[s];
  return printed;
}

/// Fits the view to the dashes, looks again, and fits again.
double settle(const Photo& photo, const Chart& chart, ChartReading& reading) {
  double distance = 0;
  for (int round = 0; round < 3; ++round) {
    reading.dashes = see_dashes(photo, chart, reading.view, reading.shift_mm);
    const std::vector<bool> printed = printed_swaths(chart, reading.dashes);
    // Shifts count from the first swath that is there.
    const auto first = static_cast<std::uint32_t>(std::ranges::find(printed, true) - printed.begin());
    std::vector<Sighting> sightings;
    for (std::size_t d = 0; d < reading.dashes.size(); ++d) {
      const DashSeen& one = reading.dashes[d];
      const std::uint32_t swath = chart.dashes[d].swath;
      if (!one.there || one.hidden || !printed[swath]) continue;
      sightings.push_back({middle_of(chart.dashes[d].box, chart), reading.view.at(one.place.x, one.place.y),
                           swath == first  ? 0
                           : swath < first ? swath + 1
                                           : swath});
    }
    if (sightings.size() < 30) return -1;
    std::vector<Spot> shifts = reading.shift_mm;
    if (first > 0 && first < shifts.size()) std::rotate(shifts.begin(), shifts.begin() + first, shifts.begin() + first + 1);
    distance = fit_view(sightings, reading.view, shifts, sightings.size() >= 200);
    if (first > 0 && first < shifts.size()) std::rotate(shifts.begin(), shifts.begin() + 1, shifts.begin() + first + 1);
    reading.shift_mm = shifts;
  }
  reading.dashes = see_dashes(photo, chart, reading.view, reading.shift_mm);
  return distance;
}

Offset offset_of(const Chart& chart, double x_mm, double y_mm) {
  const double along = chart.scan_along_x ? x_mm : y_mm, across = chart.scan_along_x ? y_mm : x_mm;
  return {1000 * along * chart.along_sign, 1000 * across * chart.across_sign};
}

/// Decides each nozzle by all of its dashes in the swaths that were printed.
void judge_nozzles(const Chart& chart, const std::vector<bool>& printed, ChartReading& reading) {
  struct Tally {
    std::uint32_t there = 0, absent = 0, laid = 0;
    std::vector<double> x, y;
  };
  std::vector<Tally> tallies(chart.nozzles);
  for (std::size_t d = 0; d < reading.dashes.size(); ++d) {
    const ChartDash& dash = chart.dashes[d];
    const DashSeen& seen = reading.dashes[d];
    Tally& tally = tallies[dash.nozzle];
    ++tally.laid;
    if (seen.hidden || !printed[dash.swath]) continue;
    ++(seen.there ? tally.there : tally.absent);
    if (!seen.there) continue;
    const Spot m = middle_of(dash.box, chart), shift = reading.shift_mm[dash.swath];
    tally.x.push_back(seen.place.x - m.x - shift.x);
    tally.y.push_back(seen.place.y - m.y - shift.y);
  }
  reading.nozzle.assign(chart.nozzles, std::nullopt);
  for (std::uint32_t n = 0; n < chart.nozzles; ++n) {
    const Tally& tally = tallies[n];
    const std::uint32_t told = tally.there + tally.absent;
    if (tally.laid == 0) continue;
    if (told == 0) {
      reading.untold.push_back(n);
    } else if (3 * tally.there <= told) {  // of three, one may be a speck of dust
      reading.blocked.push_back(n);
    } else {
      if (tally.absent * 3 > told) reading.weak.push_back(n);
      reading.nozzle[n] = offset_of(chart, settled_mean(tally.x), settled_mean(tally.y));
    }
  }
}

/// From the first place to the last where a profile is half of full ink above its ground, in mm; 0 if it never is. What gaps
/// lie between them does not count, and blur moves neither.
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

/// What is known of each line of the image from the dash on it.
struct LineSeen {
  bool known = false, there = false;
  std::uint32_t swath = 0;
  double shift_mm = 0;  // across the scan, on the image
};

std::vector<LineSeen> lines_seen(const Chart& chart, const ChartReading& reading) {
  std::vector<LineSeen> lines(chart.scan_along_x ? chart.rows : chart.columns);
  for (std::size_t d = 0; d < reading.dashes.size(); ++d) {
    const ChartDash& dash = chart.dashes[d];
    const bool there = reading.nozzle[dash.nozzle].has_value();
    const double across = there ? reading.nozzle[dash.nozzle]->across_um * 1e-3 * chart.across_sign : 0;
    lines[chart.scan_along_x ? dash.box.top : dash.box.left] = {true, there, dash.swath, across};
  }
  return lines;
}

/// How much wider the lines of a bar across the scan lie than they should; nothing if one is missing or strays by `most` mm, or
/// swaths meet in it.
std::optional<double> spread_of(const std::vector<LineSeen>& lines, std::uint32_t begin, std::uint32_t end, double most) {
  const LineSeen* last = nullptr;
  double first_shift = 0;
  for (std::uint32_t i = begin; i < end; ++i) {
    const LineSeen& line = lines[i];
    if (!line.known) continue;  // of another pass
    if (!line.there || (last != nullptr && last->swath != line.swath)) return std::nullopt;
    if (last != nullptr && std::abs(line.shift_mm - last->shift_mm) > most) return std::nullopt;
    if (last == nullptr) first_shift = line.shift_mm;
    last = &line;
  }
  return last == nullptr ? 0 : last->shift_mm - first_shift;
}

struct BarSeen {
  double wide = 0, reach = 0;  // mm; wide as it would be printed without gain
  std::vector<double> profile;
};

std::vector<BarSeen> see_bars(const Photo& photo, const Chart& chart, const ChartReading& reading, bool along) {
  const bool axis_x = along == chart.scan_along_x;  // of the width
  const std::vector<LineSeen> lines = lines_seen(chart, reading);
  std::vector<BarSeen> bars;
  for (const ChartBar& bar : chart.bars) {
    if (bar.along != along) continue;
    const double x = (bar.box.right - bar.box.left) * 1e-6 * chart.pixel_x_nm,
                 y = (bar.box.bottom - bar.box.top) * 1e-6 * chart.pixel_y_nm;
    const double wide = axis_x ? x : y, high = axis_x ? y : x, reach = wide / 2 + 0.45;
    const auto spread = along ? std::optional(0.0)
                              : spread_of(lines, axis_x ? bar.box.left : bar.box.top, axis_x ? bar.box.right : bar.box.bottom,
                                          0.4e-6 * (axis_x ? chart.pixel_x_nm : chart.pixel_y_nm));
    if (!spread) continue;
    bars.push_back({wide + *spread, reach, stripe(photo, reading.view, middle_of(bar.box, chart), axis_x, reach, 0.3 * high)});
    if (bars.back().profile.size() < 20) bars.pop_back();
  }
  return bars;
}

void measure_bars(const Photo& photo, const Chart& chart, ChartReading& reading) {
  constexpr double kWideEnough = 0.4;  // mm: the middle is free of blur
  double full = 0;
  for (const bool along : {true, false}) {
    const std::vector<BarSeen> bars = see_bars(photo, chart, reading, along);
    std::vector<double> gains;
    for (const BarSeen& bar : bars) {
      // Full ink is what bars along the scan show, of which many nozzles have a part.
      if (along)
        full = std::max(full, median_of({bar.profile.begin() + static_cast<std::ptrdiff_t>(bar.profile.size() * 2 / 5),
                                         bar.profile.begin() + static_cast<std::ptrdiff_t>(bar.profile.size() * 3 / 5 + 1)}));
    }
    for (const BarSeen& bar : bars) {
      const double gain = full > 0 ? 1000 * (width_of(bar.profile, bar.reach, full) - bar.wide) / 2 : 1000;
      if (bar.wide > kWideEnough && std::abs(gain) < 400) gains.push_back(gain);
    }
    (along ? reading.gain_along_um : reading.gain_across_um) = median_of(gains);
    (along ? reading.bars_along : reading.bars_across) = static_cast<std::uint32_t>(gains.size());
  }
}

void measure_wedges(const Photo& photo, const Chart& chart, ChartReading& reading) {
  std::vector<double> dark;
  for (const ChartWedge& wedge : chart.wedges) {
    const double x = (wedge.box.right - wedge.box.left) * 1e-6 * chart.pixel_x_nm,
                 y = (wedge.box.bottom - wedge.box.top) * 1e-6 * chart.pixel_y_nm;
    const auto profile = stripe(photo, reading.view, middle_of(wedge.box, chart), true, 0.35 * x, 0.35 * y);
    double sum = 0;
    for (const double value : profile) sum += value;
    dark.push_back(profile.empty() ? 0 : sum / static_cast<double>(profile.size()));
  }
  const double full = dark.empty() ? 0 : *std::ranges::max_element(dark);
  for (std::size_t w = 0; w < dark.size() && full > 0; ++w)
    reading.wedges.emplace_back(chart.wedges[w].percent, 100 * dark[w] / full);
}

}  // namespace

Result<ChartReading> read_chart_photo(const Photo& photo, const Chart& chart) {
  const auto view = find_marks(photo, chart);
  if (!view) return view.error();
  ChartReading reading;
  reading.view = *view;
  reading.shift_mm.assign(chart.swaths, {});
  const double distance = settle(photo, chart, reading);
  const std::vector<bool> printed = printed_swaths(chart, reading.dashes);
  const auto there =
      static_cast<std::size_t>(std::ranges::count_if(reading.dashes, [](const DashSeen& one) { return one.there; }));
  if (distance < 0 || there * 10 < chart.dashes.size())
    return Error{Fault::kInput,
                 "the chart is found, but fewer than a tenth of its dashes: photograph it sharper, or from nearer"};
  const Spot m = middle_of({0, 0, chart.columns, chart.rows}, chart);
  reading.pixels_a_mm = reading.view.pixels_a_mm(m.x, m.y);
  reading.scatter_um = 1000 * distance / reading.pixels_a_mm;
  judge_nozzles(chart, printed, reading);
  const auto first = static_cast<std::size_t>(std::ranges::find(printed, true) - printed.begin());
  for (std::uint32_t s = 0; s < chart.swaths; ++s) {
    const Spot from = reading.shift_mm[first], to = reading.shift_mm[s];
    reading.swath.push_back(printed[s] ? std::optional(offset_of(chart, to.x - from.x, to.y - from.y)) : std::nullopt);
  }
  measure_bars(photo, chart, reading);
  measure_wedges(photo, chart, reading);
  return reading;
}

Json reading_json(const ChartReading& reading) {
  const auto offsets = [](const std::vector<std::optional<Offset>>& list) {
    const auto rounded = [](double um) { return std::round(10 * um) / 10; };
    Json json = Json::array();
    for (const auto& one : list)
      json.push_back(one ? Json{{"along_um", rounded(one->along_um)}, {"across_um", rounded(one->across_um)}} : Json());
    return json;
  };
  Json json = {{"pixels_a_mm", reading.pixels_a_mm}, {"scatter_um", reading.scatter_um},
               {"blocked", reading.blocked},         {"weak", reading.weak},
               {"untold", reading.untold},           {"swaths", offsets(reading.swath)},
               {"nozzles", offsets(reading.nozzle)}};
  // Where no bar across the scan is whole, what is known is the gain along it.
  if (reading.bars_along > 0)
    json["dot_gain_um"] = {{"along", reading.gain_along_um},
                           {"across", reading.bars_across > 0 ? reading.gain_across_um : reading.gain_along_um}};
  json["wedges"] = Json::array();
  for (const auto& [percent, seen] : reading.wedges)
    json["wedges"].push_back({{"pixels_percent", percent}, {"seen_percent", seen}});
  return json;
}

cv::Mat picture_of(const Photo& photo, const Chart& chart, const ChartReading& reading) {
  cv::Mat picture;
  cv::cvtColor(photo.grey, picture, cv::COLOR_GRAY2BGR);
  const auto at = [&](const Spot& mm) {
    const Spot p = reading.view.at(mm.x, mm.y);
    return cv::Point(static_cast<int>(std::lround(p.x)), static_cast<int>(std::lround(p.y)));
  };
  const cv::Scalar green(60, 170, 40), red(40, 40, 220), orange(20, 140, 240), blue(200, 120, 30);
  for (std::size_t d = 0; d < reading.dashes.size(); ++d) {
    const DashSeen& seen = reading.dashes[d];
    const ChartBox& box = chart.dashes[d].box;
    const Spot m = middle_of(box, chart), a{box.left * 1e-6 * chart.pixel_x_nm - m.x, box.top * 1e-6 * chart.pixel_y_nm - m.y};
    const Spot half = chart.scan_along_x ? Spot{a.x, 0} : Spot{0, a.y};
    const cv::Scalar& colour = seen.hidden ? orange : seen.there ? green : red;
    cv::line(picture, at({seen.place.x + half.x, seen.place.y + half.y}), at({seen.place.x - half.x, seen.place.y - half.y}),
             colour, seen.there ? 1 : 2, cv::LINE_AA);
  }
  for (const ChartBox& mark : chart.marks) {
    const Spot m = middle_of(mark, chart);
    cv::circle(picture, at(m), static_cast<int>(1.3 * chart.mark_mm * reading.pixels_a_mm), blue, 2, cv::LINE_AA);
  }
  return picture;
}

}  // namespace lamina::scan
