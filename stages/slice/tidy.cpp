#include "stages/slice/tidy.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace lamina::slice {
namespace {

using Int128 = __int128;

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

/// Whether p is further than `tolerance` from the stretch a to b; and its squared distance, roughly, for comparing.
struct Distance {
  bool beyond;
  double squared;
};
Distance from_stretch(Point2 p, Point2 a, Point2 b, Nm tolerance) {
  const std::int64_t ux = std::int64_t{b.x} - a.x, uy = std::int64_t{b.y} - a.y;
  const std::int64_t vx = std::int64_t{p.x} - a.x, vy = std::int64_t{p.y} - a.y;
  const Int128 along = Int128{ux} * vx + Int128{uy} * vy, length2 = Int128{ux} * ux + Int128{uy} * uy;
  const Int128 limit2 = Int128{tolerance} * tolerance;
  if (along <= 0 || along >= length2) {  // the nearer end
    const std::int64_t wx = along <= 0 ? vx : std::int64_t{p.x} - b.x, wy = along <= 0 ? vy : std::int64_t{p.y} - b.y;
    const Int128 squared = Int128{wx} * wx + Int128{wy} * wy;
    return {squared > limit2, static_cast<double>(squared)};
  }
  // |cross| > tolerance * length, both sides below 2^64 and so compared by their double-width squares.
  const auto area = static_cast<long double>(Int128{ux} * vy - Int128{uy} * vx);
  const long double squared = area / static_cast<long double>(length2) * area;
  return {squared > static_cast<long double>(limit2), static_cast<double>(squared)};
}

void mark_kept(std::span<const Point2> points, std::size_t from, std::size_t to, Nm tolerance,
               std::vector<std::uint8_t>& kept) {
  std::vector<std::pair<std::size_t, std::size_t>> open{{from, to}};
  const auto at = [&](std::size_t i) { return points[i % points.size()]; };
  while (!open.empty()) {
    const auto [first, last] = open.back();
    open.pop_back();
    std::size_t furthest = first;
    double most = -1;
    bool beyond = false;
    for (std::size_t i = first + 1; i < last; ++i) {
      const Distance distance = from_stretch(at(i), at(first), at(last), tolerance);
      beyond |= distance.beyond;
      if (distance.squared > most) {
        most = distance.squared;
        furthest = i;
      }
    }
    if (!beyond) continue;
    kept[furthest % points.size()] = 1;
    open.emplace_back(first, furthest);
    open.emplace_back(furthest, last);
  }
}

/// Keeps two points far apart, and between them what the tolerance needs.
std::size_t simplify(std::span<Point2> points, Nm tolerance) {
  if (points.size() < 4) return points.size();
  const std::size_t low = static_cast<std::size_t>(std::min_element(points.begin(), points.end()) - points.begin());
  const std::size_t high = static_cast<std::size_t>(std::max_element(points.begin(), points.end()) - points.begin());
  std::vector<std::uint8_t> kept(points.size(), 0);
  kept[low] = kept[high] = 1;
  mark_kept(points, low, high > low ? high : high + points.size(), tolerance, kept);
  mark_kept(points, high, low > high ? low : low + points.size(), tolerance, kept);
  std::size_t size = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (kept[i] != 0) points[size++] = points[i];
  }
  return size;
}

}  // namespace

void tidy(Contours& contours, Nm tolerance) {
  Point2* const points = contours.point.data();
  std::uint32_t kept_points = 0, kept_contours = 0, begin = 0;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const std::uint32_t end = contours.offset[c + 1];
    std::size_t size = drop_straight(points + begin, points + end, points + kept_points);
    if (tolerance > 0 && size > 3) {
      size = simplify({points + kept_points, size}, tolerance);
      size = drop_straight(points + kept_points, points + kept_points + size, points + kept_points);
    }
    begin = end;
    if (size == 0) continue;
    kept_points += static_cast<std::uint32_t>(size);
    contours.offset[++kept_contours] = kept_points;
  }
  contours.offset.resize(kept_contours + 1);
  contours.point.resize(kept_points);
}

}  // namespace lamina::slice
