#include "stages/slice/nest.h"

#include <algorithm>
#include <numeric>
#include <vector>

namespace lamina::slice {
namespace {

struct Outline {
  Point2 lo{INT32_MAX, INT32_MAX}, hi{INT32_MIN, INT32_MIN};
  Point2 leftmost{};  // the lowest of these
  bool counter_clockwise = true;
};

Outline outline_of(std::span<const Point2> points) {
  Outline outline;
  for (const Point2 p : points) {
    outline.lo = {std::min(outline.lo.x, p.x), std::min(outline.lo.y, p.y)};
    outline.hi = {std::max(outline.hi.x, p.x), std::max(outline.hi.y, p.y)};
  }
  // A simple contour turns at its smallest point as it does on the whole.
  const std::size_t n = points.size();
  const std::size_t i = static_cast<std::size_t>(std::min_element(points.begin(), points.end()) - points.begin());
  const Point2 a = points[(i + n - 1) % n], b = points[i], c = points[(i + 1) % n];
  outline.leftmost = b;
  outline.counter_clockwise = (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - b.y) >
                              (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - b.x);
  return outline;
}

/// Whether p lies inside a simple contour that it is not on: crossings of the ray towards -x.
bool is_inside(std::span<const Point2> points, Point2 p) {
  bool inside = false;
  Point2 a = points.back();
  for (const Point2 b : points) {
    if ((a.y <= p.y) != (b.y <= p.y)) {
      const Point2 low = a.y < b.y ? a : b, high = a.y < b.y ? b : a;
      const std::int64_t area = (std::int64_t{high.x} - low.x) * (std::int64_t{p.y} - low.y) -
                                (std::int64_t{high.y} - low.y) * (std::int64_t{p.x} - low.x);
      inside ^= area < 0;  // p is right of the edge
    }
    a = b;
  }
  return inside;
}

}  // namespace

void nest(Contours& contours, FillRule rule) {
  const std::uint32_t count = contours.size();
  std::vector<Outline> outlines(count);
  for (std::uint32_t c = 0; c < count; ++c) outlines[c] = outline_of(contours[c]);
  std::vector<std::uint32_t> by_left(count);
  std::iota(by_left.begin(), by_left.end(), 0u);
  std::ranges::sort(by_left, {}, [&](std::uint32_t c) { return std::pair(outlines[c].lo.x, c); });

  std::vector<std::int8_t> turn(count);  // 0: drop, 1: keep, -1: keep reversed
  std::vector<std::uint32_t> open;       // contours whose box may still reach what comes
  for (const std::uint32_t c : by_left) {
    const Outline& own = outlines[c];
    std::erase_if(open, [&](std::uint32_t other) { return outlines[other].hi.x < own.lo.x; });
    std::int32_t outside = 0;
    for (const std::uint32_t other : open) {
      const Outline& around = outlines[other];
      if (around.lo.y < own.leftmost.y && own.leftmost.y < around.hi.y && own.hi.x < around.hi.x &&
          is_inside(contours[other], own.leftmost)) {
        outside += around.counter_clockwise ? 1 : -1;
      }
    }
    const bool solid_outside = is_solid(rule, outside);
    const bool solid_inside = is_solid(rule, outside + (own.counter_clockwise ? 1 : -1));
    turn[c] = static_cast<std::int8_t>(solid_inside == solid_outside ? 0 : solid_inside == own.counter_clockwise ? 1 : -1);
    open.push_back(c);
  }

  std::uint32_t kept_points = 0, kept_contours = 0, begin = 0;
  for (std::uint32_t c = 0; c < count; ++c) {
    const std::uint32_t end = contours.offset[c + 1];
    if (turn[c] != 0) {
      const auto first = contours.point.begin() + kept_points;
      if (kept_points != begin) std::copy(contours.point.begin() + begin, contours.point.begin() + end, first);
      kept_points += end - begin;
      if (turn[c] < 0) std::reverse(first, contours.point.begin() + kept_points);
      contours.offset[++kept_contours] = kept_points;
    }
    begin = end;
  }
  contours.offset.resize(kept_contours + 1);
  contours.point.resize(kept_points);
}

}  // namespace lamina::slice
