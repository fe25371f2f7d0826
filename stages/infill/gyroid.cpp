#include "stages/infill/gyroid.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::infill {
namespace {

constexpr double kFullTurn = 2 * std::numbers::pi;
constexpr int kSteps = 24;  // of a period; chords are within 0.5 % of a period

}  // namespace

GyroidSection::GyroidSection(double z, double period) : period_(period) {
  const double angle = z / period * kFullTurn;
  sin_z_ = std::sin(angle);
  cos_z_ = std::cos(angle);
  over_y_ = sin_z_ * sin_z_ >= 0.5;
}

GyroidSection::Across GyroidSection::across_at(double along) const {
  const double s = std::sin(along), c = std::cos(along);
  // a sin u + b cos u = right, u across.
  const double a = over_y_ ? c : cos_z_, b = over_y_ ? sin_z_ : s, right = over_y_ ? -s * cos_z_ : -sin_z_ * c;
  const double half = std::asin(std::clamp(right / std::hypot(a, b), -1.0, 1.0));
  // The one of a and b that does not depend on `along` decides where the angle of (a, b) has no jump.
  const bool turned = !over_y_ && cos_z_ < 0;
  const double phase = turned ? std::atan2(-b, -a) + std::numbers::pi : std::atan2(b, a);
  return {half - phase, std::numbers::pi - 2 * half};
}

GyroidSection::NumberInterval GyroidSection::steps(Point2 low, Point2 high) const {
  const double step = period_ / kSteps;
  return {static_cast<std::int64_t>(std::floor(along(low) / step)), static_cast<std::int64_t>(std::ceil(along(high) / step))};
}

GyroidSection::NumberInterval GyroidSection::curves(Point2 low, Point2 high) const {
  // Angles of the first position are between -5/4 and 3/4 of a turn, the second is at most a turn further.
  const double from = over_y_ ? low.x : low.y, to = over_y_ ? high.x : high.y;
  return {2 * (static_cast<std::int64_t>(std::floor(from / period_)) - 2),
          2 * (static_cast<std::int64_t>(std::ceil(to / period_)) + 3)};
}

std::uint64_t GyroidSection::count_points(Point2 low, Point2 high) const {
  const NumberInterval step = steps(low, high), curve = curves(low, high);
  return static_cast<std::uint64_t>((step.last - step.first + 1) * (curve.last - curve.first));
}

void GyroidSection::append_curves(Point2 low, Point2 high, Contours& out) const {
  const NumberInterval step = steps(low, high), curve = curves(low, high);
  const double margin = period_ / kSteps * 2;  // between two points a curve moves less across
  const double from = (over_y_ ? low.x : low.y) - margin, to = (over_y_ ? high.x : high.y) + margin;
  for (std::int64_t number = curve.first; number < curve.last; ++number) {
    const std::size_t before = out.point.size();
    bool meets = false;
    for (std::int64_t i = step.first; i <= step.last; ++i) {
      const Across across = across_at(static_cast<double>(i % kSteps) * kFullTurn / kSteps);
      const double angle = across.first + (number % 2 != 0 ? across.width : 0);
      const double u = (angle / kFullTurn + static_cast<double>(floor_div<std::int64_t>(number, 2))) * period_;
      const double v = static_cast<double>(i) * period_ / kSteps;
      meets |= u >= from && u <= to;
      const auto x = static_cast<Nm>(std::llround(over_y_ ? u : v)), y = static_cast<Nm>(std::llround(over_y_ ? v : u));
      out.point.push_back({x, y});
    }
    if (meets) {
      out.close();
    } else {
      out.point.resize(before);
    }
  }
}

std::int64_t GyroidSection::nearest_curve(Point2 p) const {
  const Across across = across_at(along(p) / period_ * kFullTurn);
  const double u = (over_y_ ? p.x : p.y) / period_ * kFullTurn;
  const auto turns = [&](double first) { return (u - first) / kFullTurn; };
  const double even = turns(across.first), odd = turns(across.first + across.width);
  const double even_off = std::abs(even - std::round(even)), odd_off = std::abs(odd - std::round(odd));
  return even_off <= odd_off ? 2 * std::llround(even) : 2 * std::llround(odd) + 1;
}

double gyroid_length() {
  static const double mean = [] {
    constexpr int kHeights = 720;
    constexpr Nm kPeriod = 1'000'000'000;
    double sum = 0;
    for (int i = 0; i < kHeights; ++i) {
      const GyroidSection section((i + 0.5) / kHeights * kPeriod, kPeriod);
      Contours curves;
      section.append_curves({0, 0}, {kPeriod, kPeriod}, curves);
      // Of one period along, both curves: each is as long as any other of its parity.
      double length = 0;
      int counted = 0;
      for (std::uint32_t c = 0; c < curves.size() && counted < 2; ++c, ++counted) {
        const auto points = curves[c];
        for (int k = 0; k < kSteps; ++k) {
          length += std::hypot(static_cast<double>(points[k + 1].x) - points[k].x,
                               static_cast<double>(points[k + 1].y) - points[k].y);
        }
      }
      sum += length / kPeriod;
    }
    return sum / kHeights;
  }();
  return mean;
}

}  // namespace lamina::infill
