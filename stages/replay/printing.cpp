#include "stages/replay/printing.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace lamina::replay {

Printing::Printing(const VirtualMachine& machine, const Layer& layer, Purpose purpose, const VirtualMachine::Watch* watch,
                   std::uint32_t planes)
    : machine_(machine),
      watch_(watch),
      layer_(layer),
      purpose_(purpose),
      row_words_((machine.columns_ + 63) / 64),
      roller_mm_(machine.machine_.powder.roller_mm[0]),
      planes_(planes),
      times_bits_(static_cast<std::uint32_t>(std::bit_width(planes))),
      fired_(purpose == Purpose::kPrint ? std::size_t{row_words_} * machine.rows_ * times_bits_ : 0, 0),
      fires_row_(purpose == Purpose::kPrint ? machine.rows_ : 0, 0) {}

Standing Printing::standing() const {
  const auto& motion = profile().motion;
  return {motion.safe_mm[0], motion.safe_mm[1], profile().powder.build_sign * (mm(layer_.bottom) - base_mm()),
          profile().powder.roller_mm[0]};
}

void Printing::fail(std::string what) {
  if (ok()) fault_ = std::move(what);
}

void Printing::fault(std::string_view what) {
  if (!ok()) return;
  const bool ahead = reading_sweep_ != INT64_MIN;  // its words are read, and it has not begun
  std::string place = fmt::format("layer {}", layer_.index);
  if (ahead || sweeping_) {
    place += fmt::format(", swath {}", ahead ? reading_sweep_ : std::int64_t{sweep_});
    if (reading_ != INT64_MIN) {
      place += fmt::format(", step {}", reading_);
    } else {
      place += stepped_ && !ahead ? fmt::format(", step {}", step_) : ", before its first step";
    }
  } else {
    place += ", before its first swath";
  }
  fail(fmt::format("{}: {}", place, what));
}

void Printing::begin_sweep(std::uint32_t number, bool backward, std::optional<std::uint32_t> of) {
  leave_sweep();
  if (sweeping_ && number <= sweep_ && !(sweeps_.empty())) {
    // Further sweeps for blocked nozzles have higher numbers than the regular ones that follow them.
    for (const Sweep& sweep : sweeps_) {
      if (sweep.number == number) return fault(fmt::format("swath {} begins a second time", number));
    }
  }
  sweep_ = number;
  reading_sweep_ = INT64_MIN;
  backward_ = backward;
  sweeping_ = true;
  stepped_ = false;
  fired_here_ = false;
  ++count.sweeps;
  host_spread_ = true;
  if (of) tells_sweep(*of);
  check_spread();
}

void Printing::go_across(double carriage_mm) {
  const auto& mount = profile().mounting;
  const bool x = mount.scan_axis == ScanAxis::kX;
  double um = (carriage_mm - mount.offset_mm[x ? 1 : 0]) * 1000;
  // From the side of nozzle 0: back and right are the far ends.
  const bool far = mount.nozzle_0 == Side::kBack || mount.nozzle_0 == Side::kRight;
  if (far) um = machine_.lines_ * machine_.line_um_ - um;
  const double line = um / machine_.line_um_ - 0.5;
  first_line_ = std::llround(line);
  if (std::abs(line - static_cast<double>(first_line_)) > 0.02) {
    fault(fmt::format("the head stands {:.2f} lines beside line {}", line - static_cast<double>(first_line_), first_line_));
  }
}

double Printing::position_of(double step) const {
  const auto& mount = profile().mounting;
  double um = 0.5 * machine_.place_um_ + step * machine_.step_um_;
  if (mount.scan_from == Side::kRight || mount.scan_from == Side::kBack) um = machine_.places_ * machine_.place_um_ - um;
  return um / 1000 + mount.offset_mm[mount.scan_axis == ScanAxis::kX ? 0 : 1];
}

std::int64_t Printing::step_at(double carriage_mm) {
  const double one = position_of(1) - position_of(0), step = (carriage_mm - position_of(0)) / one;
  if (std::abs(step - std::round(step)) > 0.05) {
    fault(fmt::format("{:.4f} mm is {:.2f} steps beside a step", carriage_mm, step - std::round(step)));
    return 0;
  }
  return std::llround(step);
}

void Printing::at_step(std::int64_t step) {
  reading_ = INT64_MIN;
  if (!sweeping_) return fault("vectors before a swath");
  previous_step_ = step_;
  const bool moved = stepped_;
  step_ = step;
  stepped_ = true;
  if (moved && (backward_ ? step >= previous_step_ : step <= previous_step_)) {
    return fault(fmt::format("the head would have to go back from step {}", previous_step_));
  }
  ++count.vectors;
}

bool Printing::pixel(std::int64_t line, std::int64_t place, std::uint32_t& column, std::uint32_t& row) const {
  if (line < 0 || place < 0 || line >= machine_.lines_ || place >= machine_.places_) return false;
  const auto& mount = profile().mounting;
  const bool x = mount.scan_axis == ScanAxis::kX;
  const auto from_left = x ? place : line, from_back = x ? line : place;
  const auto has = [&](Side side) { return mount.scan_from == side || mount.nozzle_0 == side; };
  column = static_cast<std::uint32_t>(has(Side::kRight) ? machine_.columns_ - 1 - from_left : from_left);
  row = static_cast<std::uint32_t>(has(Side::kFront) ? machine_.rows_ - 1 - from_back : from_back);
  return true;
}

void Printing::head_moves(double mm, double mm_s, bool scanning, std::uint32_t drops) {
  const double hertz = drops * mm_s * 1000 / machine_.place_um_;
  const double rounded = drops * kHalfMmPerMinute * 1000 / machine_.place_um_;  // speeds are written so
  if (scanning && hertz > profile().head.highest_frequency_hz * (1 + 1e-4) + rounded) {
    return fault(fmt::format("scans at {:g} mm/s, where nozzles fire {:.0f} times a second; they can {:.0f}", mm_s, hertz,
                             profile().head.highest_frequency_hz));
  }
  check_speed(mm_s, scanning);
  (scanning ? count.scan_mm : count.travel_mm) += std::abs(mm);
  const double way = std::abs(mm), a = profile().motion.acceleration_mm_s2;
  takes(a == 0 ? way / mm_s : way < mm_s * mm_s / a ? 2 * std::sqrt(way / a) : way / mm_s + mm_s / a);
  if (!scanning) return;
  const auto& care = profile().care;
  if (care.spits()) check_care("fired off the bed", care.spit_layers, care.spit_seconds, spat_s_);
  if (care.wipes()) check_care("wiped", care.wipe_layers, care.wipe_seconds, wiped_s_);
  if (care.spits() && wiped_s_ > spat_s_) fault("scans behind the wiper before the head is fired off the bed");
  if (dwelt_s_ + lamp_blocks_ > 0) fault("scans behind the pause in which the layer dries");
}

// Sweeps of the BrundleFab's bar are as fast as its sprays let them, which its reader holds.
void Printing::check_speed(double mm_s, bool scanning) {
  if (purpose_ == Purpose::kTime || profile().dialect == "brundlefab") return;
  const auto& motion = profile().motion;
  if (scanning) {
    if (std::abs(mm_s - motion.scan_speed_mm_s) < 1.01 * kHalfMmPerMinute) return;
    return fault(fmt::format("scans at {:g} mm/s where {:g} have to be", mm_s, motion.scan_speed_mm_s));
  }
  const double wipe = profile().care.wipes() ? profile().care.wipe_speed_mm_s : 0;
  const double roller = roller_on_gantry() ? profile().powder.roller_speed_mm_s : 0;
  const double most = std::max({motion.travel_speed_mm_s, motion.scan_speed_mm_s, wipe, roller});
  if (mm_s > most + 1.01 * kHalfMmPerMinute)
    fault(fmt::format("the head travels at {:g} mm/s, the profile's fastest is {:g}", mm_s, most));
}

bool Printing::has_ramps(double before_mm, double behind_mm, double beside_mm) {
  const double ramp = profile().motion.ramp_mm;
  if (std::min(before_mm, behind_mm) > ramp - beside_mm) return true;
  fault(fmt::format("{:g} mm before the first drops and {:g} behind the last are left, where ramps of {:g} have to be",
                    before_mm, behind_mm, ramp));
  return false;
}

const Count& Printing::finish() {
  leave_sweep();
  const auto& powder = profile().powder;
  takes(powder.pause_s);
  const auto spread = [&](double height_mm) {
    const double by_moves = (1 + powder.dose) * height_mm / powder.vat_speed_mm_s +
                            2 * std::abs(powder.roller_mm[1] - powder.roller_mm[0]) / powder.roller_speed_mm_s;
    takes(powder.spread_s > 0 ? powder.spread_s : by_moves);
  };
  if (!tells_powder_) {
    for (std::uint32_t below = 0; below < base_layers(); ++below) spread(powder.base_layer_mm);
    spread(mm(layer_.thickness));
  }
  count.microseconds = std::llround((seconds_ < kMostSeconds ? seconds_ : kMostSeconds) * 1e6);
  return count;
}

}  // namespace lamina::replay
