#include "stages/calibration/scan/nozzles.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "stages/calibration/robust.h"
#include "stages/calibration/scan/marks.h"

namespace lamina::calibration {
namespace {

/// In um, along the scan and across it.
using Axes = std::array<double, 2>;

Axes axes_of(const Chart& chart, const Spot& mm) {
  return {1000 * along_of(chart, mm) * chart.along_sign, 1000 * across_of(chart, mm) * chart.across_sign};
}

/// freedom  degrees of it that the errors have
Offset offset_of(const Axes& um, const Axes& error_um, const Axes& freedom) {
  return {{um[0], error_um[0], errors_of_99(freedom[0]) * error_um[0]},
          {um[1], error_um[1], errors_of_99(freedom[1]) * error_um[1]}};
}

/// The detected dashes of a nozzle. um  distance of each from its position in the swath, along and across
struct NozzleTally {
  std::uint32_t there = 0, absent = 0, deposited = 0;
  std::array<std::vector<double>, 2> um;
};

std::vector<NozzleTally> tallies_of(const Chart& chart, const std::vector<DashReading>& detected,
                                    const std::vector<bool>& printed, const SheetFit& fit) {
  std::vector<NozzleTally> tallies(chart.nozzles);
  for (std::size_t d = 0; d < detected.size(); ++d) {
    const ChartDash& dash = chart.dashes[d];
    NozzleTally& tally = tallies[dash.nozzle];
    ++tally.deposited;
    if (detected[d].hidden || !printed[dash.swath]) continue;
    ++(detected[d].there ? tally.there : tally.absent);
    if (!detected[d].there || detected[d].marred) continue;
    const Spot m = middle_of(dash.box, chart), shift = fit.shift[dash.swath];
    const Axes um = axes_of(chart, {detected[d].position.x - m.x - shift.x, detected[d].position.y - m.y - shift.y});
    for (std::size_t axis = 0; axis < 2; ++axis) tally.um[axis].push_back(um[axis]);
  }
  return tallies;
}

/// The scatter of dashes about their nozzles' medians.
Axes scatter_of_dashes(const std::vector<NozzleTally>& tallies) {
  Axes scatter{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::vector<double> off;
    for (const NozzleTally& tally : tallies) {
      const double middle = median_of(tally.um[axis]), n = static_cast<double>(tally.um[axis].size());
      if (n < 2) continue;
      for (const double um : tally.um[axis]) off.push_back((um - middle) * std::sqrt(n / (n - 1)));
    }
    scatter[axis] = scatter_of(off, 0);
  }
  return scatter;
}

std::array<HeadLine, 2> lines_of(const std::vector<std::optional<Axes>>& nozzles) {
  std::array<HeadLine, 2> lines{};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    std::vector<std::pair<double, double>> values;
    for (std::size_t n = 0; n < nozzles.size(); ++n) {
      if (nozzles[n]) values.emplace_back(static_cast<double>(n), (*nozzles[n])[axis]);
    }
    if (!values.empty()) lines[axis] = line_of(values);
  }
  return lines;
}

/// Standard errors of the lines at each nozzle: what becomes of them where each nozzle lies elsewhere by its error. The middle
/// one is a median, which has the error of a single nozzle, not the smaller one of a mean.
std::vector<Axes> line_errors(const std::vector<std::optional<Axes>>& nozzles, const std::vector<std::optional<Axes>>& errors) {
  constexpr int kTimes = 50;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  std::vector<std::array<HeadLine, 2>> lines;
  for (int i = 0; i < kTimes; ++i) {
    std::vector<std::optional<Axes>> moved = nozzles;
    for (std::size_t n = 0; n < moved.size(); ++n) {
      for (std::size_t axis = 0; axis < 2 && moved[n]; ++axis) (*moved[n])[axis] += (*errors[n])[axis] * normal(random);
    }
    lines.push_back(lines_of(moved));
  }
  std::vector<Axes> line_error(nozzles.size());
  for (std::size_t n = 0; n < nozzles.size(); ++n) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double sum = 0, squares = 0;
      for (const auto& line : lines) sum += line[axis].at(static_cast<double>(n));
      for (const auto& line : lines) squares += std::pow(line[axis].at(static_cast<double>(n)) - sum / kTimes, 2);
      line_error[n][axis] = std::sqrt(squares / (kTimes - 1));
    }
  }
  return line_error;
}

/// Shifts of swaths against the first one, along the head's line, by a fit. known  which nozzles make the line
std::vector<Axes> swaths_of(const Chart& chart, const SheetFit& fit, const std::vector<bool>& known, std::uint32_t first) {
  std::vector<std::optional<Axes>> nozzles(chart.nozzles);
  for (std::uint32_t n = 0; n < chart.nozzles; ++n) {
    if (known[n]) nozzles[n] = axes_of(chart, fit.offset[n]);
  }
  const std::array<HeadLine, 2> lines = lines_of(nozzles);
  std::vector<Axes> swaths;
  for (std::uint32_t s = 0; s < chart.swaths; ++s) {
    Axes um = axes_of(chart, {fit.shift[s].x - fit.shift[first].x, fit.shift[s].y - fit.shift[first].y});
    for (std::size_t axis = 0; axis < 2; ++axis)
      um[axis] -= lines[axis].slope * (static_cast<double>(s) - first) * chart.nozzles;
    swaths.push_back(um);
  }
  return swaths;
}

constexpr std::uint32_t kGroups = 9;  // by combs, and thirds of the nozzles

/// Standard errors of swaths_of(), with kGroups - 1 degrees of freedom.
std::vector<Axes> swath_errors(const Chart& chart, const std::vector<Sighting>& all, const SheetFit& fit,
                               const std::vector<bool>& known, std::uint32_t first, bool lens) {
  std::vector<std::vector<Axes>> without;
  for (std::uint32_t g = 0; g < kGroups; ++g) {
    std::vector<Sighting> rest;
    for (const Sighting& one : all) {
      if ((3 * one.repeat + (one.nozzle + one.swath) % 3) % kGroups != g) rest.push_back(one);
    }
    SheetFit other = fit;
    fit_sheet(rest, first, lens, other);
    without.push_back(swaths_of(chart, other, known, first));
  }
  std::vector<Axes> errors(chart.swaths);
  for (std::uint32_t s = 0; s < chart.swaths; ++s) {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      double mean = 0, squares = 0;
      for (const auto& one : without) mean += one[s][axis] / kGroups;
      for (const auto& one : without) squares += (one[s][axis] - mean) * (one[s][axis] - mean);
      errors[s][axis] = std::sqrt(squares * (kGroups - 1) / kGroups);
    }
  }
  return errors;
}

}  // namespace

std::vector<bool> printed_swaths(const Chart& chart, const std::vector<DashReading>& detected) {
  std::vector<std::uint32_t> all(chart.swaths, 0), there(chart.swaths, 0);
  for (std::size_t d = 0; d < detected.size(); ++d) {
    if (detected[d].hidden) continue;
    ++all[chart.dashes[d].swath];
    there[chart.dashes[d].swath] += detected[d].there;
  }
  std::vector<bool> printed(chart.swaths);
  for (std::uint32_t s = 0; s < chart.swaths; ++s) printed[s] = there[s] * 5 > all[s];
  return printed;
}

std::vector<Sighting> sightings_of(const Chart& chart, const std::vector<DashReading>& detected, const View& view,
                                   const std::vector<bool>& printed) {
  std::vector<Sighting> sightings;
  for (std::size_t d = 0; d < detected.size(); ++d) {
    const ChartDash& dash = chart.dashes[d];
    if (!detected[d].there || detected[d].hidden || detected[d].marred || !printed[dash.swath]) continue;
    sightings.push_back({middle_of(dash.box, chart), view.at(detected[d].position.x, detected[d].position.y), dash.swath,
                         dash.nozzle, dash.repeat});
  }
  return sightings;
}

HeadReading read_head(const Chart& chart, const std::vector<DashReading>& detected, const std::vector<bool>& printed,
                      const SheetFit& fit, bool lens) {
  HeadReading head;
  head.nozzle.assign(chart.nozzles, std::nullopt);
  const std::vector<NozzleTally> tallies = tallies_of(chart, detected, printed, fit);
  const Axes scatter = scatter_of_dashes(tallies);
  std::vector<bool> known(chart.nozzles, false);
  std::vector<std::optional<Axes>> offsets(chart.nozzles), errors(chart.nozzles);
  std::vector<Axes> freedom(chart.nozzles);
  for (std::uint32_t n = 0; n < chart.nozzles; ++n) {
    const NozzleTally& tally = tallies[n];
    const std::uint32_t inspected = tally.there + tally.absent;
    if (tally.deposited == 0) continue;
    if (inspected == 0) {
      head.unreadable.push_back(n);
    } else if (3 * tally.there <= inspected) {  // of three, one may be a speck of dust
      head.blocked.push_back(n);
    } else {
      if (tally.absent * 3 > inspected) head.weak.push_back(n);
      head.nozzle[n] = Offset{};
      if (tally.um[0].empty()) continue;  // all of them marred
      known[n] = true;
      offsets[n] = errors[n] = Axes{};
      for (std::size_t axis = 0; axis < 2; ++axis) {
        const SettledMean settled = settled_mean(tally.um[axis], scatter[axis]);
        (*offsets[n])[axis] = settled.mean;
        (*errors[n])[axis] = std::max(scatter[axis], settled.deviation) / std::sqrt(static_cast<double>(settled.count));
        freedom[n][axis] = static_cast<double>(settled.count) - 1;
      }
    }
  }
  const std::array<HeadLine, 2> lines = lines_of(offsets);
  const std::vector<Axes> line_error = line_errors(offsets, errors);
  for (std::uint32_t n = 0; n < chart.nozzles; ++n) {
    if (!known[n]) continue;
    Axes um = *offsets[n], error = *errors[n];
    for (std::size_t axis = 0; axis < 2; ++axis) {
      um[axis] -= lines[axis].at(n);
      error[axis] = std::hypot(error[axis], line_error[n][axis]);
    }
    head.nozzle[n] = offset_of(um, error, freedom[n]);
  }
  const auto first = static_cast<std::uint32_t>(std::ranges::find(printed, true) - printed.begin());
  const std::vector<Sighting> all = sightings_of(chart, detected, fit.view, printed);
  const std::vector<Axes> swaths = swaths_of(chart, fit, known, first);
  const std::vector<Axes> swath_error = swath_errors(chart, all, fit, known, first, lens);
  head.swath.assign(chart.swaths, std::nullopt);
  for (std::uint32_t s = 0; s < chart.swaths; ++s) {
    if (printed[s]) head.swath[s] = offset_of(swaths[s], swath_error[s], {kGroups - 1, kGroups - 1});
  }
  return head;
}

}  // namespace lamina::calibration
