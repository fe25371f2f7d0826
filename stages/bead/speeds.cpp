// stages/bead/speeds.cpp: speeds at the joints of a line.
#include "stages/bead/speeds.h"

#include <algorithm>
#include <cmath>

namespace lamina::bead {
namespace {

/// The highest speed at one end of a way if it is `speed` at the other.
double within_reach(double speed, double length, double acceleration) {
  return std::isinf(acceleration) ? acceleration : std::sqrt(speed * speed + 2 * acceleration * length);
}

}  // namespace

double Planned::peak(double acceleration_mm_s2) const {
  if (std::isinf(acceleration_mm_s2)) return stretch.speed_mm_s;
  const double reached =
      std::sqrt((begin_mm_s * begin_mm_s + end_mm_s * end_mm_s) / 2 + acceleration_mm_s2 * stretch.length_mm);
  return std::max({begin_mm_s, end_mm_s, std::min(stretch.speed_mm_s, reached)});
}

double SpeedPlan::end_of_first(double last_mm_s) const {
  double speed = std::min(last_mm_s, waiting_.back().speed_mm_s);
  for (std::size_t i = waiting_.size() - 1; i > first_; --i) {
    speed = std::min(
        {within_reach(speed, waiting_[i].length_mm, acceleration_), waiting_[i].speed_mm_s, waiting_[i - 1].speed_mm_s});
  }
  return speed;
}

bool SpeedPlan::give(double end_mm_s, Planned& out) {
  const Stretch& s = waiting_[first_++];
  const double begin = std::min(speed_, s.speed_mm_s);
  out = {s, begin, std::min(end_mm_s, within_reach(begin, s.length_mm, acceleration_))};
  speed_ = out.end_mm_s;
  if (first_ == waiting_.size()) {
    waiting_.clear();
    first_ = 0;
  } else if (first_ > 64 && 2 * first_ > waiting_.size()) {
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(first_));
    first_ = 0;
  }
  return true;
}

bool SpeedPlan::take(Planned& out) {
  if (waiting() < 2) return false;
  const double at_least = end_of_first(0);
  if (at_least < end_of_first(waiting_.back().speed_mm_s)) return false;
  return give(at_least, out);
}

bool SpeedPlan::take_last(double speed_mm_s, Planned& out) { return waiting() > 0 && give(end_of_first(speed_mm_s), out); }

double cyclic_speed(std::span<const Stretch> period, double acceleration_mm_s2) {
  if (period.empty()) return 0;
  // The slowest joint needs no other; two rounds backwards and two forwards carry it everywhere.
  double speed = std::min(period.back().speed_mm_s, period.front().speed_mm_s);
  const auto limit = [&](const Stretch& s) {
    speed = std::min(within_reach(speed, s.length_mm, acceleration_mm_s2), s.speed_mm_s);
  };
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = period.size(); i-- > 0;) limit(period[i]);
  }
  double first = std::min(speed, period.back().speed_mm_s);
  for (int round = 0; round < 2; ++round) {
    for (const Stretch& s : period) limit(s);
  }
  return std::min({first, speed, period.front().speed_mm_s});
}

}  // namespace lamina::bead
