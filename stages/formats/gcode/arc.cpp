#include "stages/formats/gcode/arc.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::read {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kNear = 1e-6;                         // mm or radians: NEAR() and NEAR_ZERO() of Marlin
constexpr double kDeviation = Arc::kTolerance - 1e-5;  // leaves room for ends on whole nanometres
constexpr double kLongest = 1e150;                     // mm: a radius that can be squared
constexpr double kMostChords = 1e9;                    // of an arc that leaves every bed with its first one

}  // namespace

bool Arc::plan(Place from, Place to, const ArcWords& words) {
  from_ = from;
  to_ = to;
  short_radius_ = false;
  const double dx = to.x - from.x, dy = to.y - from.y;
  double i = words.i, j = words.j;
  if (words.radius) {
    const double r = *words.radius, half = std::hypot(dx, dy) / 2;
    if (r == 0 || half == 0) return false;
    const double height = std::sqrt(std::max(0.0, (r - half) * (r + half)));
    const double side = words.clockwise != (r < 0) ? -1 : 1;
    i = dx / 2 - dy / 2 / half * side * height;
    j = dy / 2 + dx / 2 / half * side * height;
    short_radius_ = std::abs(r) < 0.99 * half;
  }
  if (i == 0 && j == 0) return false;
  spoke_ = {-i, -j};

  // The spoke of the end is that of the start plus the way: written so, long radii cost no digits.
  const double radius = std::hypot(i, j);
  if (!(radius < kLongest)) return false;
  const double along = spoke_.x * dx + spoke_.y * dy, across = spoke_.x * dy - spoke_.y * dx;
  const double angle = std::atan2(across, radius * radius + along);
  const bool near = std::abs(dx) <= kNear && std::abs(dy) <= kNear;
  travel_ = angle;
  if (words.clockwise ? angle > 0 : angle < 0) travel_ += words.clockwise ? -kTurn : kTurn;
  if (words.clockwise ? angle == 0 : std::abs(angle) < kNear && near) travel_ = words.clockwise ? -kTurn : kTurn;
  if (words.clockwise && near && std::abs(travel_) < kNear) travel_ = -kTurn;
  if (travel_ == 0) return false;

  miss_ = std::abs(2 * along + dx * dx + dy * dy) / (std::hypot(spoke_.x + dx, spoke_.y + dy) + radius);
  const double step = std::min(4 * std::asin(std::sqrt(std::min(1.0, kDeviation / (2 * radius)))), kTurn / 4);
  chords_ = static_cast<std::uint64_t>(std::clamp(std::ceil(std::abs(travel_) / step), 1.0, kMostChords));
  return true;
}

Arc::Place Arc::end_of(std::uint64_t chord) const {
  if (chord >= chords_) return to_;
  const double angle = travel_ * static_cast<double>(chord) / static_cast<double>(chords_);
  const double half = std::sin(angle / 2), sine = std::sin(angle), fall = -2 * half * half;  // cos - 1
  return {from_.x + fall * spoke_.x - sine * spoke_.y, from_.y + sine * spoke_.x + fall * spoke_.y};
}

}  // namespace lamina::read
