#include "stages/geometry/contours/order.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

namespace lamina {
namespace {

constexpr std::uint32_t kNone = UINT32_MAX;

struct Bounds {
  Point2 lo, hi;
  bool outer;
};

Bounds bounds_of(std::span<const Point2> points) {
  Bounds outline{points.front(), points.front(), false};
  std::size_t smallest = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Point2 p = points[i];
    if (p < points[smallest]) smallest = i;
    outline.lo = {std::min(outline.lo.x, p.x), std::min(outline.lo.y, p.y)};
    outline.hi = {std::max(outline.hi.x, p.x), std::max(outline.hi.y, p.y)};
  }
  // A simple contour turns at its smallest point as it does on the whole.
  const std::size_t n = points.size();
  const Point2 a = points[(smallest + n - 1) % n], b = points[smallest], c = points[(smallest + 1) % n];
  const std::int64_t right = (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - b.y);
  const std::int64_t left = (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - b.x);
  outline.outer = right == left ? doubled_area(points) > 0 : right > left;  // the tip of a spike does not tell
  return outline;
}

/// 1: inside, 0: on the contour, -1: outside
int place_of(std::span<const Point2> contour, Point2 p) {
  bool inside = false;
  Point2 a = contour.back();
  for (const Point2 b : contour) {
    const std::int64_t area =
        (std::int64_t{b.x} - a.x) * (std::int64_t{p.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{p.x} - a.x);
    if (area == 0 && std::min(a.x, b.x) <= p.x && p.x <= std::max(a.x, b.x) && std::min(a.y, b.y) <= p.y &&
        p.y <= std::max(a.y, b.y)) {
      return 0;
    }
    if ((a.y <= p.y) != (b.y <= p.y) && (b.y > a.y) == (area > 0)) inside = !inside;
    a = b;
  }
  return inside ? 1 : -1;
}

/// Clean contours touch each other in points at most, so the first point that does not decides for all.
bool is_around(std::span<const Point2> outer, std::span<const Point2> hole) {
  for (const Point2 p : hole) {
    if (const int place = place_of(outer, p); place != 0) return place > 0;
  }
  const Point2 a = hole[0], b = hole[1];  // all corners touch: the middle of a side does not
  return place_of(outer, {static_cast<Nm>((std::int64_t{a.x} + b.x) / 2), static_cast<Nm>((std::int64_t{a.y} + b.y) / 2)}) >= 0;
}

/// For each hole the innermost outer contour around it.
std::vector<std::uint32_t> outers_of(const Contours& contours, const std::vector<Bounds>& outlines) {
  const std::uint32_t count = contours.size();
  std::vector<std::uint32_t> by_left(count), open, outer_of(count, kNone);
  std::iota(by_left.begin(), by_left.end(), 0u);
  // At equal sides an outer contour comes before the holes that touch it there.
  std::ranges::sort(by_left, {}, [&](std::uint32_t c) { return std::tuple(outlines[c].lo.x, !outlines[c].outer, c); });
  for (const std::uint32_t c : by_left) {
    const Bounds& own = outlines[c];
    std::erase_if(open, [&](std::uint32_t other) { return outlines[other].hi.x < own.lo.x; });
    if (own.outer) {
      open.push_back(c);
      continue;
    }
    // Of nested outer contours the inner one begins further right, and so came later.
    for (auto other = open.rbegin(); other != open.rend() && outer_of[c] == kNone; ++other) {
      const Bounds& around = outlines[*other];
      if (around.lo.y <= own.lo.y && own.hi.y <= around.hi.y && own.hi.x <= around.hi.x &&
          is_around(contours[*other], contours[c])) {
        outer_of[c] = *other;
      }
    }
  }
  return outer_of;
}

}  // namespace

void order_by_outer(Contours& contours) {
  const std::uint32_t count = contours.size();
  if (count < 2) return;
  std::vector<Bounds> outlines(count);
  std::uint32_t outers = 0, an_outer = kNone;
  for (std::uint32_t c = 0; c < count; ++c) {
    outlines[c] = bounds_of(contours[c]);
    if (outlines[c].outer) ++outers, an_outer = c;
  }
  if (outers == count || (outers == 1 && an_outer == 0)) return;
  std::vector<std::uint32_t> outer_of =
      outers == 1 ? std::vector<std::uint32_t>(count, an_outer) : outers_of(contours, outlines);
  for (std::uint32_t c = 0; c < count; ++c) {
    if (outlines[c].outer || outer_of[c] == kNone) outer_of[c] = c;
  }
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::sort(order, {}, [&](std::uint32_t c) { return std::tuple(outer_of[c], outer_of[c] != c, c); });
  if (std::ranges::is_sorted(order)) return;
  Contours ordered;
  ordered.point.reserve(contours.point.size());
  for (const std::uint32_t c : order) {
    ordered.point.insert(ordered.point.end(), contours[c].begin(), contours[c].end());
    ordered.close();
  }
  contours = std::move(ordered);
}

bool is_ordered_by_outer(const ContoursView& contours) {
  std::uint32_t outer = kNone;
  Bounds around{};
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const Bounds own = bounds_of(contours[c]);
    const __int128 area = doubled_area(contours[c]);
    if (area == 0) return false;
    if (area > 0) {
      outer = c;
      around = own;
      continue;
    }
    const bool within = outer != kNone && around.lo.x <= own.lo.x && around.lo.y <= own.lo.y && own.hi.x <= around.hi.x &&
                        own.hi.y <= around.hi.y;
    if (!within || !is_around(contours[outer], contours[c])) return false;
  }
  return true;
}

}  // namespace lamina
