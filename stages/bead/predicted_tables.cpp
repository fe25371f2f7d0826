#include "stages/bead/predicted_tables.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/bead/spread.h"

namespace lamina::bead {
namespace {

constexpr double kResolution = 0.01;  // mm, resolution of widths
constexpr double kForgotten = 10;     // lags, after which a line is as if nothing had been

/// The widths about a thin stretch between two thick ones that are long enough to forget.
struct LongInterval {
  double minimum, largest;  // mm, of the thin one and of what follows
  double stable_mm;         // from where it begins, until it is as wide as before
};

LongInterval deposit_long(const BeadMachine& machine, double height_mm, double speed, double thin_area, double thin_speed) {
  const double before = width_of(machine.area_mm2, true, height_mm);
  const auto forgotten = [&](double mm_s) {
    return kForgotten * machine.tau_s * mm_s + mm_s * mm_s / machine.acceleration_mm_s2 + 1;
  };
  const double thick = forgotten(speed), thin = forgotten(thin_speed);
  LongInterval found{before, 0, 0};
  const TakePiece take = [&](const BeadPiece& p) {
    found.minimum = std::min({found.minimum, p.begin_width_mm, p.end_width_mm});
    found.largest = std::max({found.largest, p.begin_width_mm, p.end_width_mm});
    const double back = before - kResolution;
    if (p.begin_width_mm < back && p.begin_mm >= thick * (1 - 1e-9) && p.end_mm <= (thick + thin) * (1 + 1e-9)) {
      const double share = p.end_width_mm > back ? (back - p.begin_width_mm) / (p.end_width_mm - p.begin_width_mm) : 1;
      found.stable_mm = p.begin_mm + share * (p.end_mm - p.begin_mm) - thick;
    }
  };
  BeadLine line(machine, height_mm, kResolution / 10);
  line.begin({speed, speed * machine.area_mm2, true});
  line.add({thick, machine.area_mm2, speed}, take);
  line.add({thin, thin_area, thin_speed}, take);
  line.add({thick, machine.area_mm2, speed}, take);
  line.end(speed, take);
  return found;
}

constexpr double kReach = 1.5;  // mm: half of the widest bead that spreads

std::array<LineSegment, 2> period_of(const BeadMachine& machine, const Pattern& pattern) {
  const double area = machine.area_mm2 * pattern.extrusion_percent / 100;
  return {{{pattern.thick_mm, area, pattern.thick_speed_mm_s}, {pattern.thin_mm, area, pattern.thin_speed_mm_s}}};
}

/// Gathers the widths between two places.
class Gather {
 public:
  Gather(double begin, double end) : begin_(begin), end_(end), middle_((begin + end) / 2) {}

  void add(const ProfilePiece& p) {
    const double from = std::max(p.begin_mm, begin_), to = std::min(p.end_mm, end_);
    if (from >= to) return;
    const double first = p.width_at(from), last = p.width_at(to);
    sum_ += (to - from) * (first + last) / 2;
    widths_.minimum = std::min({widths_.minimum, first, last});
    widths_.largest = std::max({widths_.largest, first, last});
    if (from <= middle_ && middle_ <= to) widths_.middle = p.width_at(middle_);
  }
  IntervalWidths widths() const {
    IntervalWidths result = widths_;
    result.mean = sum_ / (end_ - begin_);
    return result;
  }

 private:
  double begin_, end_, middle_, sum_ = 0;
  IntervalWidths widths_{0, 0, HUGE_VAL, 0};
};

}  // namespace

Calibration predicted_tables(const BeadMachine& machine, double width_mm, double height_mm, double speed_mm_s) {
  Calibration tables;
  tables.source = "predicted from the cross-section at 100 %, the lag of the melt and the acceleration (stages/bead)";
  tables.width_mm = width_mm;
  tables.height_mm = height_mm;
  tables.speed_mm_s = speed_mm_s;
  for (int percent = 125; percent <= 400; percent += 25) {
    const LongInterval deposited = deposit_long(machine, height_mm, speed_mm_s, machine.area_mm2, speed_mm_s * percent / 100);
    tables.by_speed.push_back({static_cast<double>(percent), deposited.minimum, deposited.stable_mm, deposited.largest});
  }
  for (int percent = 90; percent >= 10; percent -= 10) {
    const LongInterval deposited = deposit_long(machine, height_mm, speed_mm_s, machine.area_mm2 * percent / 100, speed_mm_s);
    tables.by_extrusion.push_back({static_cast<double>(percent), deposited.minimum});
  }
  const double even = width_of(machine.area_mm2, true, height_mm);
  for (const auto& [extrusion, thick_speed] : {std::pair{75.0, 100.0}, {100.0, 75.0}, {125.0, 50.0}}) {
    const Pattern pattern{1.5, 1.5, extrusion, speed_mm_s * thick_speed / 100, speed_mm_s * 2};
    const PatternWidths deposited = steady_widths(machine, height_mm, pattern, true);
    tables.repeated.push_back({extrusion, 200, thick_speed, deposited.thick.middle, deposited.thin.middle, even});
  }
  return tables;
}

// One period of a pattern in its steady state, and its widths.

PatternSums steady_profile(const BeadMachine& machine, double height_mm, const Pattern& pattern, bool spread,
                           const TakeProfile& take) {
  const auto period = period_of(machine, pattern);
  const Joint joint = steady_joint(machine, height_mm, period);
  const double length = pattern.thick_mm + pattern.thin_mm;
  const int before = spread ? static_cast<int>(std::ceil(2 * kReach / length)) : 0;
  const double begin = before * length;
  const auto see = [&](double a, double b, double width_a, double width_b) {
    const double from = std::max(a, begin), to = std::min(b, begin + length);
    if (from >= to) return;
    const auto at = [&](double position) { return width_a + (width_b - width_a) * (position - a) / (b - a); };
    take({from - begin, to - begin, at(from), at(to)});
  };
  BeadSpread pen(height_mm, std::min(0.02, std::min(pattern.thick_mm, pattern.thin_mm) / 20), kReach);
  double position = -HUGE_VAL, width = 0;
  const TakeCell cell = [&](const SpreadCell& c) {
    const double middle = (c.begin_mm + c.end_mm) / 2;
    if (std::isfinite(position)) see(position, middle, width, c.width_mm);
    position = middle;
    width = c.width_mm;
  };
  const TakePiece piece = [&](const BeadPiece& p) {
    if (spread) return pen.add(p, cell);
    see(p.begin_mm, p.end_mm, p.begin_width_mm, p.end_width_mm);
  };
  BeadLine line(machine, height_mm, 0.001);
  line.begin(joint);
  for (int i = 0; i <= 2 * before; ++i) {
    for (const LineSegment& segment : period) line.add(segment, piece);
  }
  line.end(joint.speed_mm_s, piece);
  if (spread) pen.end(cell);
  const int periods = 2 * before + 1;
  const Planned thin{period[1], std::min(period[0].speed_mm_s, period[1].speed_mm_s), joint.speed_mm_s};
  return {line.fed_mm3() / periods, line.seconds() / periods, joint.flow_mm3_s, thin.peak(machine.acceleration_mm_s2)};
}

PatternWidths steady_widths(const BeadMachine& machine, double height_mm, const Pattern& pattern, bool spread) {
  Gather thick(0, pattern.thick_mm), thin(pattern.thick_mm, pattern.thick_mm + pattern.thin_mm);
  const PatternSums sums = steady_profile(machine, height_mm, pattern, spread, [&](const ProfilePiece& p) {
    thick.add(p);
    thin.add(p);
  });
  return {thick.widths(), thin.widths(), sums};
}

}  // namespace lamina::bead
