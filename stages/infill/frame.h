// stages/infill/frame.h: a layer turned so that its lines run along +x.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

#include "stages/data/contours.h"
#include "stages/infill/parameters.h"

namespace lamina::infill {

/// u runs along the lines, v across them, nm from a centre. Whole quarter turns are exact; others are rounded to the
/// nearest nm, so that a point there and back again is off by at most 1 nm in x and y.
///
/// Directions that differ by half a turn share a frame: their lines are the same lines, laid the other way.
class Frame {
 public:
  Frame(MicroDegrees angle, Point2 centre)
      : quarter_(static_cast<int>(angle % (kTurn / 2) / (kTurn / 4))),
        exact_(angle % (kTurn / 4) == 0),
        reversed_(angle >= kTurn / 2),
        centre_(centre) {
    const double turn = static_cast<double>(angle % (kTurn / 2)) * 1e-6 * std::numbers::pi / 180;
    cos_ = std::cos(turn);
    sin_ = std::sin(turn);
  }

  /// Whether lines are laid towards -u first.
  bool reversed() const { return reversed_; }

  Point2 to(Point2 p) const {
    const std::int64_t x = std::int64_t{p.x} - centre_.x, y = std::int64_t{p.y} - centre_.y;
    if (exact_) return quarter_ == 0 ? whole(x, y) : whole(y, -x);
    const auto u = static_cast<double>(x), v = static_cast<double>(y);
    return whole(std::llround(cos_ * u + sin_ * v), std::llround(cos_ * v - sin_ * u));
  }

  Point2 from(Point2 p) const {
    if (exact_) {
      return quarter_ == 0 ? whole(std::int64_t{p.x} + centre_.x, std::int64_t{p.y} + centre_.y)
                           : whole(std::int64_t{centre_.x} - p.y, std::int64_t{centre_.y} + p.x);
    }
    const double u = p.x, v = p.y;
    return whole(std::llround(cos_ * u - sin_ * v) + centre_.x, std::llround(sin_ * u + cos_ * v) + centre_.y);
  }

  Contours to(const ContoursView& contours) const {
    Contours turned;
    turned.offset.assign(contours.offset.begin(), contours.offset.end());
    turned.point.resize(contours.point.size());
    for (std::size_t i = 0; i < contours.point.size(); ++i) turned.point[i] = to(contours.point[i]);
    return turned;
  }

 private:
  static Point2 whole(std::int64_t x, std::int64_t y) { return {static_cast<Nm>(x), static_cast<Nm>(y)}; }

  int quarter_;
  bool exact_, reversed_;
  double cos_, sin_;
  Point2 centre_;
};

}  // namespace lamina::infill
