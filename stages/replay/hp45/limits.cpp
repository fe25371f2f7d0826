#include "stages/replay/hp45/limits.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/replay/gcode.h"

namespace lamina::replay::hp45 {
namespace {

constexpr double kMarginMm = 100;  // beside the bed, besides ramps
// PositionUpdate measures the speed every 50 counts (POSITION_STEP_COUNT); 100 ms behind the last measure it is 0
// (POSITION_STEP_TIMEOUT), and bursts need one. It is held in whole mm/s.
constexpr double kMinCountsPerSecond = 500;
constexpr std::uint32_t kMaxPrimed = 25'000;  // HP45_Standalone_V4.ino, PRM: constrain()

}  // namespace

std::optional<std::uint32_t> primed(std::string_view number) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::uint32_t bursts = 0;
  for (const char c : number) {
    const std::size_t digit = kDigits.find(c);
    if (digit == std::string_view::npos || bursts > kMaxPrimed) return std::nullopt;
    bursts = bursts * 64 + static_cast<std::uint32_t>(digit);
  }
  if (bursts > kMaxPrimed) return std::nullopt;
  return bursts;
}

Status check_encoder(double counts, double encoder_dpi, double step_um) {
  if (counts == encoder_dpi) return {};
  if (encoder_dpi <= 0) {  // 600, or what pixels need
    if (counts <= 600 + 2 * 25'400 / step_um) return {};
    return Error{Fault::kVerification,
                 fmt::format("SER has {:g} counts an inch, far more than pixels of {:.1f} um need", counts, step_um)};
  }
  return Error{Fault::kVerification,
               fmt::format("SER has {:g} counts an inch, the machine's encoder {:g}", counts, encoder_dpi)};
}

// Along the scan: the bed with ramps and room, where the head waits, and the spreader's ends if the gantry has it.
bool reaches(const Printing& printing, double counts_per_inch, double mm) {
  const auto& profile = printing.profile();
  const std::string& along = ScanAxes(profile).along;
  const bool x = profile.mounting.scan_axis == ScanAxis::kX;
  const double begin = profile.mounting.offset_mm[x ? 0 : 1],
               offset = x ? printing.axis_positions().x_mm : printing.axis_positions().y_mm;
  double low = std::min(begin, offset), high = std::max(begin + profile.bed.size_mm[x ? 0 : 1], offset);
  if (profile.powder.roller_axis == along) {
    low = std::min({low, profile.powder.roller_mm[0], profile.powder.roller_mm[1]});
    high = std::max({high, profile.powder.roller_mm[0], profile.powder.roller_mm[1]});
  }
  // The run-up takes two measures of speed, of 50 counts each.
  if (const auto& maintenance = profile.maintenance; maintenance.spits() || maintenance.wipes() || maintenance.cap_mm) {
    const std::size_t i = x ? 0 : 1;
    for (const auto& position : {maintenance.spit_mm, maintenance.cap_mm}) {
      if (position) low = std::min(low, (*position)[i]), high = std::max(high, (*position)[i]);
    }
    if (maintenance.wipe_mm) {
      low = std::min({low, (*maintenance.wipe_mm)[i], (*maintenance.wipe_mm)[2 + i]});
      high = std::max({high, (*maintenance.wipe_mm)[i], (*maintenance.wipe_mm)[2 + i]});
    }
  }
  const double row_mm = printing.nozzles() * profile.head.pitch_um / 1000;  // of a tilted head
  const double clearance = kMarginMm + row_mm + profile.motion.ramp_mm + 110 * 25.4 / counts_per_inch;
  return mm >= low - clearance && mm <= high + clearance;
}

Status check_speed(double mm_s, double counts_per_inch) {
  const double counts = mm_s / 25.4 * counts_per_inch;
  if (std::abs(mm_s - std::round(mm_s)) > 1e-3) {
    return Error{Fault::kVerification, fmt::format("sweeps at {:g} mm/s, which the controller cuts to whole mm/s", mm_s)};
  }
  if (counts >= kMinCountsPerSecond) return {};
  return Error{Fault::kVerification,
               fmt::format("sweeps at {:g} mm/s, {:.0f} counts a second: below {:.0f} the controller takes the head to rest",
                           mm_s, counts, kMinCountsPerSecond)};
}

}  // namespace lamina::replay::hp45
