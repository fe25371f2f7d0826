// tests/bead/anet.h: the test pieces of Di Nisio 2022 as line segments, and the beads that the model deposits for them.
#pragma once

#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "stages/bead/line.h"
#include "stages/bead/spread.h"
#include "tests/bead/stabilisation.h"
#include "tests/segment/table.h"

namespace lamina::bead::test {

constexpr double kAtOnce = std::numeric_limits<double>::infinity();
constexpr double kHeight = 0.3, kReference = 15;  // mm, mm/s: Table 2
constexpr double kProfile = 500;                  // mm/s2: the profile's, not the document's

/// Table 11, the column of distances; widths are not read.
inline std::vector<StableAfter> stabilisation_column() {
  std::vector<StableAfter> rows;
  for (const auto& row : lamina::test::table(11)) {
    rows.push_back({lamina::test::number(row, "thin_speed_mm_s"), lamina::test::number(row, "stabilisation_distance_mm")});
  }
  return rows;
}

/// 100 % deposits the set width of 0.4 mm at the set height (3.1.2), or what the profile feeds: 85 % of the rectangle.
inline double set_area() { return bead_area(0.4, kHeight); }
constexpr double kProfileArea = 0.85 * 0.4 * 0.3;

inline BeadMachine anet(double area, double acceleration) {
  BeadMachine machine{area, 0, acceleration};
  machine.tau_s = time_constant(machine, {kHeight, kReference, 0.01}, stabilisation_column());
  return machine;
}

struct Width {
  double position, width;
};

/// Widths along a line between two places, in order: at the ends of pieces, or of cells after spreading.
inline std::vector<Width> deposit(const BeadMachine& machine, const std::vector<LineSegment>& intervals, const Joint& from,
                                  double to, bool spread) {
  std::vector<Width> widths;
  BeadLine line(machine, kHeight, 1e-4);
  BeadSpread pen(kHeight);
  const TakeCell cell = [&](const SpreadCell& c) { widths.push_back({(c.begin_mm + c.end_mm) / 2, c.width_mm}); };
  const TakePiece take = [&](const BeadPiece& p) {
    if (spread) return pen.add(p, cell);
    widths.push_back({p.begin_mm, p.begin_width_mm});
    widths.push_back({p.end_mm, p.end_width_mm});
  };
  line.begin(from);
  for (const LineSegment& s : intervals) line.add(s, take);
  line.end(to, take);
  if (spread) pen.end(cell);
  return widths;
}

inline double width_at(const std::vector<Width>& widths, double position) {
  for (std::size_t i = 1; i < widths.size(); ++i) {
    if (widths[i].position < position || widths[i].position <= widths[i - 1].position) continue;
    const double share = (position - widths[i - 1].position) / (widths[i].position - widths[i - 1].position);
    return widths[i - 1].width + share * (widths[i].width - widths[i - 1].width);
  }
  return 0;
}

inline double mean_width(const std::vector<Width>& widths, double begin, double end) {
  double sum = 0;
  constexpr int kPositions = 300;
  for (int i = 0; i < kPositions; ++i) sum += width_at(widths, begin + (end - begin) * (i + 0.5) / kPositions);
  return sum / kPositions;
}

/// Thick and thin stretches of 1.5 mm in turn (Tables 13 to 16) in their steady state: six periods, of which the fourth begins
/// at 9.
inline std::vector<Width> deposit_repeated(const BeadMachine& machine, double extrusion_percent, double thick_speed,
                                           bool spread) {
  const double area = machine.area_mm2 * extrusion_percent / 100;
  const std::vector<LineSegment> period{{1.5, area, thick_speed}, {1.5, area, 30}};
  std::vector<LineSegment> intervals;
  for (int i = 0; i < 6; ++i) intervals.insert(intervals.end(), period.begin(), period.end());
  const Joint joint = steady_joint(machine, kHeight, period);
  return deposit(machine, intervals, joint, joint.speed_mm_s, spread);
}

struct Repeated {
  std::string sample;
  double extrusion, thick_speed, thick, thin;  // mean widths of the three regions
};

inline std::vector<Repeated> repeated_samples() {
  std::vector<Repeated> samples;
  for (const auto& [number, speed] : {std::pair{13, 15.0}, {14, 11.25}, {15, 7.5}}) {
    std::map<std::string, std::array<double, 3>> sums;
    for (const auto& row : lamina::test::table(number)) {
      auto& sum = sums[row.at("sample")];
      sum[0] += lamina::test::number(row, "thick_mm");
      sum[1] += lamina::test::number(row, "thin_mm");
      sum[2] += 1;
    }
    for (const auto& [name, sum] : sums) {
      samples.push_back({name, std::stod(name.substr(1)), speed, sum[0] / sum[2], sum[1] / sum[2]});
    }
  }
  return samples;
}

/// Root of the mean square of what is added.
struct Rms {
  double sum = 0;
  int count = 0;
  void add(double error) {
    sum += error * error;
    ++count;
  }
  double value() const { return std::sqrt(sum / count); }
};

}  // namespace lamina::bead::test
