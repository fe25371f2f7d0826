#include "stages/segment/measured.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace lamina::segment {
namespace {

Error at_row(const Measured& row, const std::string& what) { return {Fault::kInput, fmt::format("row {}: {}", row.row, what)}; }

struct Mean {
  double sum = 0;
  int count = 0;
  void add(double value) {
    sum += value;
    ++count;
  }
  double value() const { return sum / count; }
};

/// The widths of one thick speed: means of the regions, then of all regions alike.
struct Tried {
  std::map<std::string, std::array<Mean, 3>> regions;  // thick, thin, continuous

  std::array<double, 3> means() const {
    std::array<double, 3> of{};
    for (const auto& [name, widths] : regions) {
      for (std::size_t i = 0; i < 3; ++i) of[i] += widths[i].value() / static_cast<double>(regions.size());
    }
    return of;
  }
  double deviation() const {
    double maximum = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      double low = INFINITY, high = 0;
      for (const auto& [name, widths] : regions) {
        low = std::min(low, widths[i].value());
        high = std::max(high, widths[i].value());
      }
      maximum = std::max(maximum, high - low);
    }
    return maximum;
  }
};

std::string percent_text(double percent) { return fmt::format("{:g} %", percent); }

Spacing spacing_of(const Calibration::Repeated& widths, const MeasuringSettings& settings) {
  if (settings.exact_spacing) return spacing_for(widths.thick_mm, widths.continuous_mm, settings.gap_mm);
  return {published_spacing(widths.thick_mm, settings.width_mm) + settings.gap_mm, settings.width_mm + settings.gap_mm};
}

}  // namespace

Result<MeasuredMachine> calibrate(const std::vector<Measured>& rows, const MeasuringSettings& settings,
                                  const std::string& source) {
  MeasuredMachine machine;
  Calibration& calibration = machine.calibration;
  calibration = {source, settings.width_mm, settings.height_mm, settings.speed_mm_s, {}, {}, {}, {}};
  Mean walls;
  std::map<double, const Measured*> speeds, extrusions;
  std::map<double, std::map<double, Tried>> repeated;  // by extrusion, then by thick speed
  for (const Measured& row : rows) {
    switch (row.test) {
      case Measured::Test::kFlow:
        if (row.wall) walls.add(*row.wall);
        break;
      case Measured::Test::kSpeed:
        if (!row.thin && !row.stable && !row.thick) break;  // not measured
        if (!row.thin) return at_row(row, "thin_mm is empty; measure the narrowest place of the thin stretch");
        if (!row.stable)
          return at_row(
              row, "stable_mm is empty; measure from the start of the thin stretch to where the bead is as wide as before");
        if (!row.thick) return at_row(row, "thick_mm is empty; measure the widest place after the thin stretch");
        if (row.percent <= 100)
          return at_row(row, fmt::format("percent is {:g}; speeds of thin stretches are above 100", row.percent));
        if (!speeds.emplace(row.percent, &row).second)
          return at_row(row, fmt::format("{} stands twice", percent_text(row.percent)));
        break;
      case Measured::Test::kExtrusion:
        if (!row.thin) break;
        if (row.percent <= 0 || row.percent >= 100)
          return at_row(row, fmt::format("percent is {:g}; extrusions of thin stretches are between 0 and 100", row.percent));
        if (!extrusions.emplace(row.percent, &row).second)
          return at_row(row, fmt::format("{} stands twice", percent_text(row.percent)));
        break;
      case Measured::Test::kRepeated: {
        if (!row.thick && !row.thin && !row.continuous) break;
        const std::array<std::pair<const char*, std::optional<double>>, 3> widths{
            {{"thick_mm", row.thick}, {"thin_mm", row.thin}, {"continuous_mm", row.continuous}}};
        auto& region = repeated[row.percent][row.thick_speed_percent].regions[row.region];
        for (std::size_t i = 0; i < 3; ++i) {
          if (!widths[i].second)
            return at_row(row, fmt::format("{} is empty; measure all three widths of a region", widths[i].first));
          region[i].add(*widths[i].second);
        }
        break;
      }
    }
  }
  if (walls.count == 0 && speeds.empty() && extrusions.empty() && repeated.empty()) {
    return Error{Fault::kInput, "holds no widths; fill in what was measured"};
  }
  if (walls.count > 0) machine.flow = settings.flow * 2 * settings.width_mm / walls.value();
  for (const auto& [percent, row] : speeds) calibration.by_speed.push_back({percent, *row->thin, *row->stable, *row->thick});
  for (const auto& [percent, row] : extrusions)
    calibration.by_extrusion.insert(calibration.by_extrusion.begin(), {percent, *row->thin});
  for (const auto& [extrusion, by_speed] : repeated) {
    const auto best = std::ranges::min_element(by_speed, {}, [](const auto& tried) { return tried.second.deviation(); });
    const auto means = best->second.means();
    Settled settled{{extrusion, settings.thin_speed_percent, best->first, means[0], means[1], means[2]},
                    {},
                    best->second.deviation(),
                    by_speed.size()};
    settled.spacing = spacing_of(settled.widths, settings);
    calibration.repeated.push_back(settled.widths);
    calibration.spacing.push_back({extrusion, settled.spacing.segmented, settled.spacing.continuous});
    if (best->second.regions.size() < 2) {
      machine.advice.push_back(
          fmt::format("extrusion {}: widths of one region only; measure an initial, a central and a final one to see "
                      "whether they change along the part",
                      percent_text(extrusion)));
    } else if (settled.deviation_mm > kAcceptedDeviation + 1e-9) {
      machine.advice.push_back(fmt::format(
          "extrusion {}: widths change by {:.3f} mm along the part at {} of the speed, more than {} mm; print its "
          "piece again with a lower thick speed",
          percent_text(extrusion), settled.deviation_mm, percent_text(by_speed.begin()->first), kAcceptedDeviation));
    }
    machine.settled.push_back(settled);
  }
  if (speeds.empty()) machine.advice.push_back("no widths by speed: nothing is known of how long a thin stretch may be");
  if (repeated.empty()) machine.advice.push_back("no widths of repeated stretches: spacings cannot follow from them");
  return machine;
}

}  // namespace lamina::segment
