// stages/geometry/contours/meet.h: whether two straight stretches share a point, exactly.
#pragma once

#include <algorithm>
#include <cstdint>

#include "stages/data/contours.h"

namespace lamina {

/// 1: p lies left of the line from a to b, -1: right of it, 0: on it
inline int side_of(Point2 a, Point2 b, Point2 p) {
  // Coordinates of a bed differ by less than 2^31, so nothing overflows.
  const std::int64_t area =
      (std::int64_t{b.x} - a.x) * (std::int64_t{p.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{p.x} - a.x);
  return area > 0 ? 1 : area < 0 ? -1 : 0;
}

/// Whether the boxes around stretches ab and cd share a point.
inline bool boxes_meet(Point2 a, Point2 b, Point2 c, Point2 d) {
  return std::max(a.x, b.x) >= std::min(c.x, d.x) && std::max(c.x, d.x) >= std::min(a.x, b.x) &&
         std::max(a.y, b.y) >= std::min(c.y, d.y) && std::max(c.y, d.y) >= std::min(a.y, b.y);
}

/// Whether stretches ab and cd share a point, ends included.
inline bool stretches_meet(Point2 a, Point2 b, Point2 c, Point2 d) {
  // Boxes meet, so collinear stretches do.
  return boxes_meet(a, b, c, d) && side_of(a, b, c) * side_of(a, b, d) <= 0 && side_of(c, d, a) * side_of(c, d, b) <= 0;
}

}  // namespace lamina
