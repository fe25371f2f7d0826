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

void Printing::begin_sweep(std::uint32_t number, bool backward) {
  leave_sweep();
  if (sweeping_ && number <= sweep_ && !(sweeps_.empty())) {
    // Further sweeps for blocked nozzles have higher numbers than the regular ones that follow them.
    for (const Sweep& sweep : sweeps_) {
      if (sweep.number == number) return fault(fmt::format("swath {} begins a second time", number));
    }
  }
  sweep_ = number;
  fires_on_old_ = fires_on_old_ || !rolled_;
  reading_sweep_ = INT64_MIN;
  backward_ = backward;
  sweeping_ = true;
  stepped_ = false;
  fired_here_ = false;
  ++count.sweeps;
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

void Printing::wrong_cycle(std::string_view what) { fail(fmt::format("layer {}, powder cycle: {}", layer_.index, what)); }

void Printing::feeds(std::uint32_t vat, double mm, double mm_s) {
  count.fed_mm[vat] += mm;
  if (mm > 0) count.vats |= 1u << vat;
  tells_powder_ = true;
  takes(std::abs(mm) / mm_s);
}

void Printing::build_vat_stands_at(double mm) {
  count.moves = tells_powder_ = true;
  count.build_mm = mm * profile().powder.build_sign;
}

void Printing::build_vat_goes_down(double mm) {
  count.moves = tells_powder_ = true;
  lowered_mm_ = mm;
}

void Printing::roller_stands_at(double mm) {
  tells_powder_ = true;
  const double far = profile().powder.roller_mm[1];
  const bool comes = std::abs(roller_mm_ - far) >= 1e-3 || std::abs(profile().powder.roller_mm[0] - far) < 1e-3;
  if (std::abs(mm - far) < 1e-3 && comes) strokes(count.build_mm, count.fed_mm[0] + count.fed_mm[1]);
  rolled_ = rolled_ || strokes_ > base_layers();
  const double home = profile().powder.roller_mm[0];
  if (rpm_ != 0 && std::abs(mm - home) < 1e-3 && std::abs(roller_mm_ - home) >= 1e-3 && spread_wrong_.empty()) {
    spread_wrong_ = fmt::format("the roller returns with {:g} turns a minute, and has to stand still", rpm_);
  }
  roller_mm_ = mm;
}

// A layer without a base has its powder checked at its end alone, as ever: strokes are counted, and told by the last one.
void Printing::strokes(double build_mm, double fed_mm) {
  const auto& powder = profile().powder;
  ++strokes_;
  if (powder.roller_rpm > 0 && std::abs(rpm_ - powder.roller_rpm) > 1e-3 && spread_wrong_.empty()) {
    spread_wrong_ = fmt::format("the roller spreads with {:g} turns a minute where {:g} have to be", rpm_, powder.roller_rpm);
  }
  if (profile().dialect == "oasis" || strokes_ > base_layers() || !spread_wrong_.empty()) return;
  const double above = base_mm() - strokes_ * powder.base_layer_mm;  // of the base, still to be spread
  const double build = mm(layer_.bottom) - above, fed = powder.dose * strokes_ * powder.base_layer_mm;
  if (std::abs(build_mm - build) > 1e-3 || std::abs(fed_mm - fed) > 1e-3 * strokes_) {
    spread_wrong_ =
        fmt::format("layer {} of the base is spread with the build vat at {:g} mm and {:g} mm fed, not {:g} and {:g}", strokes_,
                    build_mm, fed_mm, build, fed);
  }
}

void Printing::spreads(double build_mm, double fed_mm, double clearance_mm) {
  const auto& powder = profile().powder;
  const bool base = strokes_ < base_layers();
  const double height = base ? (strokes_ + 1) * powder.base_layer_mm : base_mm() + mm(layer_.thickness);
  const double build = build_mm * powder.build_sign, top = mm(layer_.bottom) - base_mm() + height - clearance_mm;
  const double fed = powder.dose * height + clearance_mm;
  if (!spread_wrong_.empty()) return;
  if (std::abs(build - top) > 1e-3) {
    spread_wrong_ = fmt::format("powder is spread with the build vat at {:g} mm where {:g} have to be", build, top);
  } else if (std::abs(fed_mm - fed) > 1e-3) {
    spread_wrong_ = fmt::format("powder is spread with {:g} mm fed where {:g} have to be", fed_mm, fed);
  }
}

void Printing::check_cycle() {
  const auto& powder = profile().powder;
  const Layer& layer = layer_;
  const auto wrong = [&](const std::string& what) { wrong_cycle(what); };
  if (const Standing next = standing(); head_mm_ && std::hypot((*head_mm_)[0] - next.x_mm, (*head_mm_)[1] - next.y_mm) > 1e-3) {
    wrong(fmt::format("the head stays at {:g}, {:g} mm, and the next layer finds it at {:g}, {:g}", (*head_mm_)[0],
                      (*head_mm_)[1], next.x_mm, next.y_mm));
  }
  if (lowered_mm_) count.build_mm = mm(layer.bottom) + *lowered_mm_;
  if (profile().dialect == "raw" || profile().dialect == "planes") return check_told();  // the head alone
  if (!count.moves) return wrong("the build vat does not move");
  if (!spread_wrong_.empty()) return wrong(spread_wrong_);
  // Numbers are written to a tenth of a micrometre.
  if (const double top = mm(std::int64_t{layer.bottom} + layer.thickness); std::abs(count.build_mm - top) > 1e-3) {
    wrong(fmt::format("the build vat stands at {:g} mm where {:g} have to", count.build_mm, top));
  }
  const double fed = count.fed_mm[0] + count.fed_mm[1], dose = powder.dose * (mm(layer.thickness) + base_mm());
  if (std::abs(fed - dose) > 1e-3 * (1 + base_layers())) wrong(fmt::format("{:g} mm are fed where {:g} have to", fed, dose));
  if (!rolled_) wrong(fmt::format("the roller does not reach its far end at {:g} mm", powder.roller_mm[1]));
  check_pauses();
  if (fires_on_old_) wrong("the first sweep begins before powder is spread");
  if (std::abs(roller_mm_ - powder.roller_mm[0]) > 1e-3) {
    wrong(fmt::format("the roller stays at {:g} mm, not at {:g}", roller_mm_, powder.roller_mm[0]));
  }
}

const Count& Printing::finish() {
  leave_sweep();
  leave_place();
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
