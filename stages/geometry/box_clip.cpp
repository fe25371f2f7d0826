#include "stages/geometry/box_clip.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace lamina {
namespace {

/// One side of a box: what is at most, or at least, at a position along an axis is in it.
struct BoxSide {
  Nm Point2::*axis;
  Nm Point2::*other;
  Nm at;
  bool upper;

  bool has(Point2 p) const { return upper ? p.*axis <= at : p.*axis >= at; }
  Point2 crossing(Point2 a, Point2 b) const {
    const double share = (static_cast<double>(at) - a.*axis) / (static_cast<double>(b.*axis) - a.*axis);
    Point2 p{};
    p.*axis = at;
    p.*other = static_cast<Nm>(std::llround(a.*other + share * (static_cast<double>(b.*other) - a.*other)));
    return p;
  }
};

void cut(const Buffer<Point2>& from, const BoxSide& side, Buffer<Point2>& to) {
  to.clear();
  for (std::size_t i = 0; i < from.size(); ++i) {
    // A crossing is calculated in one direction, whichever way the edge runs.
    const Point2 a = from[i], b = from[i + 1 < from.size() ? i + 1 : 0];
    if (side.has(a)) to.push_back(a);
    if (side.has(a) != side.has(b)) to.push_back(a < b ? side.crossing(a, b) : side.crossing(b, a));
  }
}

}  // namespace

void clip_to_box(const ContoursView& contours, Point2 lo, Point2 hi, Contours& out) {
  const BoxSide sides[] = {{&Point2::x, &Point2::y, lo.x, false},
                           {&Point2::x, &Point2::y, hi.x, true},
                           {&Point2::y, &Point2::x, lo.y, false},
                           {&Point2::y, &Point2::x, hi.y, true}};
  Buffer<Point2> points, next;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 low{INT32_MAX, INT32_MAX}, high{INT32_MIN, INT32_MIN};
    for (const Point2 p : contours[c]) {
      low = {std::min(low.x, p.x), std::min(low.y, p.y)};
      high = {std::max(high.x, p.x), std::max(high.y, p.y)};
    }
    if (low.x > hi.x || low.y > hi.y || high.x < lo.x || high.y < lo.y) continue;
    points.assign(contours[c].begin(), contours[c].end());
    for (const BoxSide& side : sides) {
      if (side.has(low) && side.has(high)) continue;
      cut(points, side, next);
      std::swap(points, next);
    }
    if (points.size() < 3) continue;
    out.point.insert(out.point.end(), points.begin(), points.end());
    out.close();
  }
}

}  // namespace lamina
