#include "stages/geometry/contours/merge.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace lamina {
namespace {

constexpr double kRounding = 1;  // nm that a new point may be off

struct Vector {
  double x, y;
};
Vector from_to(Point2 a, Point2 b) { return {static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y}; }
double cross(Vector a, Vector b) { return a.x * b.y - a.y * b.x; }

/// nm from a point to the nearest one of a stretch.
double apart(Point2 p, Point2 a, Point2 b) {
  const Vector u = from_to(a, b), v = from_to(a, p);
  const double length2 = u.x * u.x + u.y * u.y;
  const double share = length2 > 0 ? std::clamp((u.x * v.x + u.y * v.y) / length2, 0.0, 1.0) : 0;
  return std::hypot(v.x - share * u.x, v.y - share * u.y);
}

/// The point for both ends of bc, between a and d.
Point2 merged(Point2 a, Point2 b, Point2 c, Point2 d) {
  const Vector before = from_to(a, b), own = from_to(b, c), after = from_to(c, d);
  const double first = cross(before, own), second = cross(own, after), both = cross(before, after);
  Vector by{own.x / 2, own.y / 2};
  if (first * second > 0 && both * first > 0) {
    const double beyond = second / both;  // of ab, past b, to where it meets cd
    by = {by.x / 2 + before.x * beyond / 2, by.y / 2 + before.y * beyond / 2};
  }
  return {static_cast<Nm>(std::lround(b.x + by.x)), static_cast<Nm>(std::lround(b.y + by.y))};
}

/// Appends a contour with its short edges merged, no point of it twice. returns  whether any was
bool append_merged(std::span<const Point2> points, double shortest, double tolerance, Contours& out) {
  const std::size_t count = points.size(), begin = out.point.size();
  std::size_t left = count;
  bool any = false;
  for (std::size_t i = 0; i < count; ++i) {
    const Point2 b = points[i], c = points[i + 1 < count ? i + 1 : 0];
    const Vector own = from_to(b, c);
    const bool first_stays = i + 1 < count;  // the seam's edge would need the point that has been laid first
    if (left > 4 && first_stays && own.x * own.x + own.y * own.y < shortest * shortest) {
      const Point2 a = out.point.size() > begin ? out.point.back() : points.back();
      const Point2 d = points[i + 2 < count ? i + 2 : i + 2 - count];
      const Point2 p = merged(a, b, c, d);
      if (apart(p, b, c) <= tolerance && apart(b, a, p) <= tolerance && apart(c, p, d) <= tolerance) {
        out.point.push_back(p);
        --left;
        ++i;
        any = true;
        continue;
      }
    }
    out.point.push_back(b);
  }
  out.close();
  return any;
}

}  // namespace

void merge_short_edges(Contours& contours, Nm shortest, Nm tolerance, MergeScratch& scratch) {
  if (tolerance <= kRounding) return;
  scratch.merged.clear();
  bool any = false;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    any |= append_merged(contours[c], shortest, tolerance - kRounding, scratch.merged);
  }
  if (any && !find_contacts(scratch.merged, scratch.contact, scratch.group)) std::swap(contours, scratch.merged);
}

}  // namespace lamina
