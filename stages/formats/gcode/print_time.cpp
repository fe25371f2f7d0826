#include "stages/formats/gcode/print_time.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::formats::gcode {
namespace {

constexpr double kCruiseRatio = 0.5;     // Klipper's minimum_cruise_ratio
constexpr double kFilamentCorner = 1.0;  // mm/s, Klipper's instantaneous_corner_velocity

}  // namespace

double rest_to_rest(double length_mm, double speed_mm_s, double acceleration_mm_s2) {
  const double ramps = speed_mm_s * speed_mm_s / acceleration_mm_s2;
  if (length_mm < ramps) return 2 * std::sqrt(length_mm / acceleration_mm_s2);
  return length_mm / speed_mm_s + speed_mm_s / acceleration_mm_s2;
}

PrintTime::PrintTime(const Extruder& machine)
    : klipper_(machine.code.flavor == "Klipper"),
      acceleration_(machine.speed.acceleration_mm_s2),
      filament_acceleration_(acceleration_),
      corner_(machine.speed.corner_mm_s),
      gentle_(klipper_ ? 1 - kCruiseRatio : 1) {
  if (!klipper_) return;
  // max_extrude_only_accel: 4 nozzle^2 is max_extrude_cross_section.
  const double nozzle = machine.material.nozzle_mm, filament = machine.material.filament_mm;
  filament_acceleration_ *= 4 * nozzle * nozzle / (std::numbers::pi / 4 * filament * filament);
}

/// Marlin: the highest speed at which no axis changes by more than the corner speed; after a halt, from 0.
double PrintTime::jerk_entry(const Direction& direction) const {
  const double shared = moving_ ? std::min(direction.speed, before_.speed) : direction.speed;
  double change = 0;
  for (std::size_t axis = 0; axis < direction.unit.size(); ++axis) {
    const double from = moving_ ? before_.unit[axis] : 0;
    change = std::max(change, std::abs(direction.unit[axis] - from) * shared);
  }
  return change > corner_ ? shared * corner_ / change : shared;
}

/// Klipper: a circle touches both lines; its distance from the corner is the junction deviation, and it touches them within
/// half of each.
double PrintTime::corner_entry2(const PlannedMove& move, const Direction& direction) const {
  const PlannedMove& previous = moves_[size_ - 1];
  double entry2 = std::min({move.speed2, previous.speed2, previous.entry2 + previous.rise});
  const double turn = std::abs(direction.unit[3] - before_.unit[3]);
  if (turn > 0) entry2 = std::min(entry2, kFilamentCorner / turn * kFilamentCorner / turn);
  double cosine = 0;  // of the angle between the lines: -1 straight on
  for (std::size_t axis = 0; axis < 3; ++axis) cosine -= direction.unit[axis] * before_.unit[axis];
  const double half_sine = std::sqrt(std::max(0.0, (1 - cosine) / 2)), half_cosine = std::sqrt(std::max(0.0, (1 + cosine) / 2));
  if (half_sine >= 1 || half_cosine <= 0) return entry2;
  const double by_deviation = corner_ * corner_ * (std::numbers::sqrt2 - 1) * half_sine / (1 - half_sine);
  return std::min({entry2, by_deviation, std::min(move.rise, previous.rise) * half_sine / half_cosine / 4});
}

void PrintTime::move(const Delta& delta_mm, double speed_mm_s) {
  const double way = std::hypot(delta_mm[0], delta_mm[1], delta_mm[2]);
  const double length = way > 0 ? way : std::abs(delta_mm[3]);
  if (length <= 0) return;
  if (klipper_ && way <= 0) {
    halt();
    seconds_ += rest_to_rest(length, speed_mm_s, filament_acceleration_);
    return;
  }
  Direction direction{delta_mm, speed_mm_s};
  for (double& share : direction.unit) share /= length;
  PlannedMove move{length, acceleration_, speed_mm_s * speed_mm_s, 0, 2 * acceleration_ * length, 0, 0};
  move.gentle_rise = move.rise * gentle_;
  if (!klipper_) {
    const double entry = jerk_entry(direction);
    move.entry2 = entry * entry;
  } else if (moving_) {
    move.entry2 = corner_entry2(move, direction);
  }
  add(move);
  before_ = direction;
  moving_ = true;
}

void PrintTime::add(PlannedMove move) {
  if (size_ > 0) {
    const PlannedMove& previous = moves_[size_ - 1];
    move.entry2 = std::min(move.entry2, previous.entry2 + previous.rise);
    move.gentle_entry2 = std::min(move.entry2, previous.gentle_entry2 + previous.gentle_rise);
  } else {
    move.gentle_entry2 = move.entry2;
  }
  if (size_ == kMoves) finish_moves(kMoves / 2);
  moves_[size_++] = move;
}

/// Plans all moves, the last one down to a halt, and counts the time of the first ones.
void PrintTime::finish_moves(std::size_t count) {
  std::array<double, kMoves + 1> start2;
  std::array<double, kMoves> peak2;  // below 0: what the move before leaves
  start2[size_] = 0;
  double next_gentle2 = 0, ceiling2 = 0;
  std::size_t slowing = 0;  // moves after this one that only slow down
  for (std::size_t i = size_; i-- > 0;) {
    const PlannedMove& move = moves_[i];
    const double reachable2 = start2[i + 1] + move.rise, gentle_reachable2 = next_gentle2 + move.gentle_rise;
    start2[i] = std::min(move.entry2, reachable2);
    const double gentle2 = std::min(move.gentle_entry2, gentle_reachable2);
    peak2[i] = -1;
    ++slowing;
    if (gentle2 < gentle_reachable2) {
      if (gentle2 + move.gentle_rise > next_gentle2 || slowing > 1) ceiling2 = (gentle2 + gentle_reachable2) / 2;
      peak2[i] = std::min({(start2[i] + reachable2) / 2, move.speed2, ceiling2});
      slowing = 0;
    }
    next_gentle2 = gentle2;
  }
  for (std::size_t i = 0; i < count; ++i) {
    const PlannedMove& move = moves_[i];
    cruise2_ = peak2[i] >= 0 ? peak2[i] : std::min(cruise2_, start2[i]);
    const double first = std::sqrt(std::min(start2[i], cruise2_)), last = std::sqrt(std::min(start2[i + 1], cruise2_));
    const double cruise = std::sqrt(cruise2_);
    const double ramps = (2 * cruise2_ - first * first - last * last) / (2 * move.acceleration);
    seconds_ += (2 * cruise - first - last) / move.acceleration + std::max(0.0, move.length - ramps) / cruise;
  }
  std::copy(moves_.begin() + static_cast<std::ptrdiff_t>(count), moves_.begin() + static_cast<std::ptrdiff_t>(size_),
            moves_.begin());
  size_ -= count;
  if (size_ > 0) moves_[0].entry2 = start2[count];
}

double PrintTime::halt() {
  finish_moves(size_);
  cruise2_ = HUGE_VAL;
  moving_ = false;
  return seconds_;
}

}  // namespace lamina::formats::gcode
