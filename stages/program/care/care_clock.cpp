#include "stages/program/care/care_clock.h"

#include <cmath>

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

}  // namespace lamina::write
