#include "stages/program/care/care.h"

#include <cmath>

#include "stages/program/program_text.h"

namespace lamina::write {

double move_seconds(const Machine& machine, double way_mm, double speed_mm_s) {
  if (speed_mm_s * 60 >= 1) speed_mm_s = std::round(speed_mm_s * 60) / 60;  // as it is spelt
  const double a = machine.motion.acceleration_mm_s2;
  if (a == 0) return way_mm / speed_mm_s;
  return way_mm < speed_mm_s * speed_mm_s / a ? 2 * std::sqrt(way_mm / a) : way_mm / speed_mm_s + speed_mm_s / a;
}

double shot_seconds(const Machine& machine) { return machine.care.spit_drops / machine.head.highest_frequency_hz; }

double CareClock::seconds(Place from, Place to, double speed_mm_s) const {
  return move_seconds(machine_, std::hypot(to[0] - from[0], to[1] - from[1]), speed_mm_s);
}

CareClock::Due CareClock::begin_layer(std::uint32_t layer, Place at) {
  const auto& care = machine_.care;
  const auto due = [&](std::uint32_t layers, double limit_s) { return limit_s > 0 || (layers > 0 && layer % layers == 0); };
  at_ = at;
  return serve(due(care.wipe_layers, care.wipe_seconds), due(care.spit_layers, care.spit_seconds));
}

CareClock::Due CareClock::before_sweep(Place from, Place to) {
  return before_sweep(from, to, seconds(from, to, machine_.motion.scan_speed_mm_s));
}

CareClock::Due CareClock::before_sweep(Place from, Place to, double sweep_s) {
  const auto& care = machine_.care;
  const double travel = machine_.motion.travel_speed_mm_s;
  double now = seconds(at_, from, travel) + sweep_s;
  const bool shot = care.spit_seconds > 0 && since_shot_ + now > kOfCareLimit * care.spit_seconds;
  if (shot) {  // the wiper waits for the shot as well
    now = seconds(at_, *care.spit_mm, travel) + shot_s_ + seconds(*care.spit_mm, from, travel) + sweep_s;
  }
  const bool wipe = care.wipe_seconds > 0 && since_wipe_ + now > kOfCareLimit * care.wipe_seconds;
  const Due due = serve(wipe, shot);
  const double taken = seconds(at_, from, travel) + sweep_s;
  since_wipe_ += taken;
  since_shot_ += taken;
  at_ = to;
  return due;
}

CareClock::Due CareClock::serve(bool wipe, bool shot) {
  const auto& care = machine_.care;
  shot = shot || (wipe && care.spits());
  if (wipe) {
    at_ = {(*care.wipe_mm)[2], (*care.wipe_mm)[3]};
    since_wipe_ = 0;
  }
  if (shot) {
    since_wipe_ += seconds(at_, *care.spit_mm, machine_.motion.travel_speed_mm_s) + shot_s_;
    at_ = *care.spit_mm;
    since_shot_ = 0;
  }
  return {wipe, shot};
}

void Care::go(std::string_view command, double x_mm, double y_mm, double speed_mm_s, ProgramBytes& out) const {
  put(out, "{} {}{} {}{} F{}\n", command, machine_.motion.x_axis, mm_text(x_mm), machine_.motion.y_axis, mm_text(y_mm),
      feed_text(speed_mm_s));
}

void Care::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) put(out, "{}\n", line);
}

void Care::refill(const LayerCycle& cycle, ProgramBytes& out) {
  if (!cycle.refill) return;
  const auto& motion = machine_.motion;
  const auto& cap = machine_.care.cap_mm;
  if (cap) {
    go(words_.travel, (*cap)[0], (*cap)[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
  }
  put(out, "{}", words_.refill);
  if (cap) {
    go(words_.travel, motion.safe_mm[0], motion.safe_mm[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
  }
}

void Care::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
  serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
}

void Care::before_sweep(CareClock::Place from, CareClock::Place to, ProgramBytes& out) {
  serve(clock_.before_sweep(from, to), out);
}

void Care::before_sweep(CareClock::Place from, CareClock::Place to, double sweep_s, ProgramBytes& out) {
  serve(clock_.before_sweep(from, to, sweep_s), out);
}

void Care::serve(CareClock::Due due, ProgramBytes& out) const {
  const auto& care = machine_.care;
  const auto& motion = machine_.motion;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *care.wipe_mm;
    go(words_.travel, x, y, motion.travel_speed_mm_s, out);
    go("G1", to_x, to_y, care.wipe_speed_mm_s, out);
    if (!care.wipe_lines.empty()) put(out, "{}", words_.wait);
    put_own(care.wipe_lines, out);
  }
  if (due.shot) {
    go(words_.travel, (*care.spit_mm)[0], (*care.spit_mm)[1], motion.travel_speed_mm_s, out);
    put(out, "{}", words_.wait);
    words_.spit(machine_, out);
  } else if (due.wipe) {
    put(out, "{}", words_.wait);
  }
}

void Care::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  const auto at = machine_.care.cap_mm.value_or(machine_.motion.safe_mm);
  go(words_.travel, at[0], at[1], machine_.motion.travel_speed_mm_s, out);
  put(out, "{}", words_.wait);
  put_own(machine_.powder.dry_on_lines, out);
  put(out, "{}{}\n", words_.dwell,
      plain_text(machine_.powder.dry_s / words_.dwell_unit_s, words_.dwell_unit_s < 1 ? 0 : kPlainDigits));
  put_own(machine_.powder.dry_off_lines, out);
}

namespace {

/// nm as i32, in which check_care holds places.
std::uint32_t nm_field(double mm) { return static_cast<std::uint32_t>(static_cast<std::int32_t>(std::llround(mm * kNmPerMm))); }
std::uint32_t thousandths(double value) { return static_cast<std::uint32_t>(std::llround(value * 1000)); }

}  // namespace

void CareRecords::go(CareClock::Place to, ProgramBytes& out) const {
  put(CareRecord::kGo, {nm_field(to[0]), nm_field(to[1])}, out);
}

void CareRecords::begin_layer(const LayerCycle& cycle, ProgramBytes& out) {
  const auto& powder = machine_.powder;
  const auto& cap = machine_.care.cap_mm;
  if (cycle.refill) {
    if (cap) go(*cap, out);
    put(CareRecord::kFill, {}, out);
    if (cap) go(machine_.motion.safe_mm, out);
  }
  if (cycle.layer == 0 && powder.base_layers > 0) {
    put(CareRecord::kBase, {powder.base_layers, nm_field(powder.base_layer_mm)}, out);
  }
  if (powder.roller_rpm > 0) put(CareRecord::kRoller, {thousandths(powder.roller_rpm)}, out);
  serve(clock_.begin_layer(cycle.layer, machine_.motion.safe_mm), out);
}

void CareRecords::before_sweep(const Sweep& sweep, const SweepVectors& vectors, ProgramBytes& out) {
  serve(clock_.before_sweep(carriage_.place(carriage_.begin(sweep, vectors), sweep.first_line),
                            carriage_.place(carriage_.end(sweep, vectors), sweep.first_line)),
        out);
}

void CareRecords::serve(CareClock::Due due, ProgramBytes& out) const {
  const auto& care = machine_.care;
  if (due.wipe) {
    const auto& [x, y, to_x, to_y] = *care.wipe_mm;
    go({x, y}, out);
    put(CareRecord::kWipe, {nm_field(to_x), nm_field(to_y), thousandths(care.wipe_speed_mm_s)}, out);
    put_own(care.wipe_lines, out);
  }
  if (due.shot) {
    go(*care.spit_mm, out);
    put(CareRecord::kShot, {care.spit_drops}, out);
  }
}

void CareRecords::dry(ProgramBytes& out) const {
  if (machine_.powder.dry_s == 0) return;
  go(machine_.care.cap_mm.value_or(machine_.motion.safe_mm), out);
  put_own(machine_.powder.dry_on_lines, out);
  put(CareRecord::kDry, {thousandths(machine_.powder.dry_s)}, out);
  put_own(machine_.powder.dry_off_lines, out);
}

// Text in words of four bytes, the first one lowest, the last padded with zeros.
void CareRecords::put_own(const std::vector<std::string>& lines, ProgramBytes& out) const {
  for (const std::string& line : lines) {
    std::vector<std::uint32_t> words((line.size() + 3) / 4, 0);
    for (std::size_t i = 0; i < line.size(); ++i) {
      words[i / 4] |= std::uint32_t{static_cast<unsigned char>(line[i])} << (i % 4 * 8);
    }
    put_(CareRecord::kOwn, words, out);
  }
}

}  // namespace lamina::write
