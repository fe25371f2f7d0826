#include "stages/bead/predicted_tables.h"

#include <algorithm>

#include "stages/bead/pattern.h"
#include "stages/bead/section.h"

namespace lamina::bead {
namespace {

constexpr double kResolution = 0.01;  // mm, to which widths are told apart
constexpr double kForgotten = 10;     // lags, after which a line is as if nothing had been

/// The widths about a thin stretch between two thick ones that are long enough to forget.
struct LongStretch {
  double least, largest;  // mm, of the thin one and of what follows
  double stable_mm;       // from where it begins, until it is as wide as before
};

LongStretch lay_long(const BeadMachine& machine, double height_mm, double speed, double thin_area, double thin_speed) {
  const double before = width_of(machine.area_mm2, true, height_mm);
  const auto forgotten = [&](double mm_s) {
    return kForgotten * machine.tau_s * mm_s + mm_s * mm_s / machine.acceleration_mm_s2 + 1;
  };
  const double thick = forgotten(speed), thin = forgotten(thin_speed);
  LongStretch found{before, 0, 0};
  const TakePiece take = [&](const BeadPiece& p) {
    found.least = std::min({found.least, p.begin_width_mm, p.end_width_mm});
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

}  // namespace

Calibration predicted_tables(const BeadMachine& machine, double width_mm, double height_mm, double speed_mm_s) {
  Calibration tables;
  tables.source = "predicted from what 100 % lays, the lag of the melt and the acceleration (stages/bead)";
  tables.width_mm = width_mm;
  tables.height_mm = height_mm;
  tables.speed_mm_s = speed_mm_s;
  for (int percent = 125; percent <= 400; percent += 25) {
    const LongStretch laid = lay_long(machine, height_mm, speed_mm_s, machine.area_mm2, speed_mm_s * percent / 100);
    tables.by_speed.push_back({static_cast<double>(percent), laid.least, laid.stable_mm, laid.largest});
  }
  for (int percent = 90; percent >= 10; percent -= 10) {
    const LongStretch laid = lay_long(machine, height_mm, speed_mm_s, machine.area_mm2 * percent / 100, speed_mm_s);
    tables.by_extrusion.push_back({static_cast<double>(percent), laid.least});
  }
  const double even = width_of(machine.area_mm2, true, height_mm);
  for (const auto& [extrusion, thick_speed] : {std::pair{75.0, 100.0}, {100.0, 75.0}, {125.0, 50.0}}) {
    const Pattern pattern{1.5, 1.5, extrusion, speed_mm_s * thick_speed / 100, speed_mm_s * 2};
    const PatternWidths laid = steady_widths(machine, height_mm, pattern, true);
    tables.repeated.push_back({extrusion, 200, thick_speed, laid.thick.middle, laid.thin.middle, even});
  }
  return tables;
}

}  // namespace lamina::bead
