#include "stages/geometry/contours/tidy.h"

#include <algorithm>

namespace lamina {
namespace {

std::int64_t cross(Point2 a, Point2 b, Point2 c) {
  return (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - b.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - b.x);
}

/// Moves the points of [begin, end) that matter to `out`, which may be `begin`; returns how many those are.
std::size_t drop_straight(const Point2* begin, const Point2* end, Point2* out) {
  std::size_t size = 0;
  for (const Point2* p = begin; p != end; ++p) {
    const Point2 point = *p;  // `out` may reach it
    while (size > 0) {
      if (out[size - 1] == point || (size > 1 && cross(out[size - 2], out[size - 1], point) == 0)) {
        --size;
      } else {
        break;
      }
    }
    out[size++] = point;
  }
  // Around the seam.
  std::size_t first = 0;
  while (size - first >= 3) {
    if (out[size - 1] == out[first] || cross(out[size - 2], out[size - 1], out[first]) == 0) {
      --size;
    } else if (cross(out[size - 1], out[first], out[first + 1]) == 0) {
      ++first;
    } else {
      break;
    }
  }
  if (size - first < 3) return 0;
  if (first > 0) std::copy(out + first, out + size, out);
  return size - first;
}

}  // namespace

void tidy(Contours& contours) {
  Point2* const points = contours.point.data();
  std::uint32_t kept_points = 0, kept_contours = 0, begin = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const std::uint32_t end = contours.offset[c + 1];
    const std::size_t size = drop_straight(points + begin, points + end, points + kept_points);
    begin = end;
    if (size == 0) continue;
    kept_points += static_cast<std::uint32_t>(size);
    contours.offset[++kept_contours] = kept_points;
  }
  contours.offset.resize(kept_contours + 1);
  contours.point.resize(kept_points);
}

}  // namespace lamina
