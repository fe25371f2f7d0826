#include "stages/geometry/contours/edge_bands.h"

#include <cmath>
#include <cstdlib>

#include "stages/geometry/contours/contact.h"

namespace lamina {
namespace {

/// nm^2 from a point to the nearest one of an edge.
double squared_distance(Point2 p, Point2 a, Point2 b) {
  const double ux = static_cast<double>(b.x) - a.x, uy = static_cast<double>(b.y) - a.y;
  const double vx = static_cast<double>(p.x) - a.x, vy = static_cast<double>(p.y) - a.y;
  const double length2 = ux * ux + uy * uy;
  const double share = length2 > 0 ? std::clamp((ux * vx + uy * vy) / length2, 0.0, 1.0) : 0;
  const double dx = vx - share * ux, dy = vy - share * uy;
  return dx * dx + dy * dy;
}

Point2 middle(Point2 a, Point2 b) {
  return {static_cast<Nm>((std::int64_t{a.x} + b.x) / 2), static_cast<Nm>((std::int64_t{a.y} + b.y) / 2)};
}

/// Whether a half-open edge passes a point's height on its right.
bool passes_right_of(Point2 p, Point2 a, Point2 b) {
  if ((a.y <= p.y) == (b.y <= p.y)) return false;
  return b.y > a.y ? side_of(a, b, p) > 0 : side_of(a, b, p) < 0;
}

}  // namespace

bool is_inside(std::span<const Point2> contour, Point2 p) {
  bool in = false;
  for (std::size_t i = 0; i < contour.size(); ++i)
    in ^= passes_right_of(p, contour[i], contour[i + 1 < contour.size() ? i + 1 : 0]);
  return in;
}

bool is_inside(const ContoursView& contours, Point2 p) {
  bool in = false;
  for (std::uint32_t c = 0; c < contours.size(); ++c) in ^= is_inside(contours[c], p);
  return in;
}

PlanarBox grown(const PlanarBox& box, std::int64_t by) {
  const auto moved = [](Nm v, std::int64_t by_nm) {
    return static_cast<Nm>(std::clamp<std::int64_t>(v + by_nm, -kNmReach, kNmReach));
  };
  return {{moved(box.lo.x, -by), moved(box.lo.y, -by)}, {moved(box.hi.x, by), moved(box.hi.y, by)}};
}

bool is_within(const PlanarBox& inner, const PlanarBox& outer) {
  return outer.lo.x <= inner.lo.x && inner.hi.x <= outer.hi.x && outer.lo.y <= inner.lo.y && inner.hi.y <= outer.hi.y;
}

PlanarBox box_around(std::span<const Point2> points) {
  PlanarBox box;
  for (const Point2 p : points) box.add(p);
  return box;
}

void EdgeBands::build(const ContoursView& contours, std::int64_t min_height) {
  box_ = box_around(contours.point);
  std::int64_t rise = 0;
  const auto for_each_edge = [&](auto&& use) {
    for (std::uint32_t c = 0; c < contours.size(); ++c) {
      const std::span<const Point2> points = contours[c];
      for (std::size_t i = 0; i < points.size(); ++i) use(points[i], points[i + 1 < points.size() ? i + 1 : 0]);
    }
  };
  for_each_edge([&](Point2 a, Point2 b) { rise += std::abs(std::int64_t{b.y} - a.y); });
  const auto count = static_cast<std::int64_t>(contours.point.size());
  const std::int64_t extent = std::int64_t{box_.hi.y} - box_.lo.y + 1;
  height_ = std::max({std::int64_t{1}, min_height, 2 * rise / std::max<std::int64_t>(count, 1),
                      4 * extent / std::max<std::int64_t>(count, 1)});
  offset_.assign(static_cast<std::size_t>(extent / height_) + 2, 0);
  for_each_edge([&](Point2 a, Point2 b) {
    for (std::int64_t band = band_of(std::min(a.y, b.y)); band <= band_of(std::max(a.y, b.y)); ++band)
      ++offset_[static_cast<std::size_t>(band) + 1];
  });
  for (std::size_t band = 1; band < offset_.size(); ++band) offset_[band] += offset_[band - 1];
  edge_.resize(offset_.back());
  for_each_edge([&](Point2 a, Point2 b) {
    for (std::int64_t band = band_of(std::min(a.y, b.y)); band <= band_of(std::max(a.y, b.y)); ++band)
      edge_[offset_[static_cast<std::size_t>(band)]++] = {a, b};
  });
  for (std::size_t band = offset_.size() - 1; band > 0; --band) offset_[band] = offset_[band - 1];
  offset_[0] = 0;
}

bool EdgeBands::inside(Point2 p) const {
  if (p.y < box_.lo.y || p.y > box_.hi.y) return false;
  const auto band = static_cast<std::size_t>(band_of(p.y));
  bool in = false;
  for (std::uint32_t i = offset_[band]; i < offset_[band + 1]; ++i) in ^= passes_right_of(p, edge_[i].a, edge_[i].b);
  return in;
}

bool EdgeBands::meets(Point2 a, Point2 b) const {
  PlanarBox box;
  box.add(a), box.add(b);
  if (!box.meets(box_)) return false;
  const std::uint32_t begin = offset_[static_cast<std::size_t>(band_of(std::min(a.y, b.y)))],
                      end = offset_[static_cast<std::size_t>(band_of(std::max(a.y, b.y))) + 1];
  for (std::uint32_t i = begin; i < end; ++i) {
    if (intervals_meet(a, b, edge_[i].a, edge_[i].b)) return true;
  }
  return false;
}

bool EdgeBands::touches(Point2 p) const {
  const std::uint32_t begin = offset_[static_cast<std::size_t>(band_of(p.y - 2))],
                      end = offset_[static_cast<std::size_t>(band_of(p.y + 2)) + 1];
  for (std::uint32_t i = begin; i < end; ++i) {
    if (squared_distance(p, edge_[i].a, edge_[i].b) <= 4) return true;
  }
  return false;
}

bool EdgeBands::carries(Point2 a, Point2 b, double reach, bool or_inside, int divisions) const {
  const auto by = static_cast<std::int64_t>(reach) + 1;
  const std::uint32_t begin = offset_[static_cast<std::size_t>(band_of(a.y - by))],
                      end = offset_[static_cast<std::size_t>(band_of(a.y + by)) + 1];
  const double reach2 = reach * reach;
  for (std::uint32_t i = begin; i < end; ++i) {
    const Point2 from = edge_[i].a, to = edge_[i].b;
    const auto away = [&](Point2 p) {
      return p.x < std::min(from.x, to.x) - by || p.x > std::max(from.x, to.x) + by || p.y < std::min(from.y, to.y) - by ||
             p.y > std::max(from.y, to.y) + by;
    };
    if (away(a) || away(b)) continue;
    if (squared_distance(a, from, to) <= reach2 && squared_distance(b, from, to) <= reach2) return true;
  }
  if (or_inside && inside(a) && !meets(a, b)) return true;
  const Point2 half = middle(a, b);
  if (divisions == 0 || half == a || half == b) return false;
  return carries(a, half, reach, or_inside, divisions - 1) && carries(half, b, reach, or_inside, divisions - 1);
}

bool EdgeBands::is_crowded() const { return edge_.size() / (offset_.size() - 1) > 256; }

void ContainmentTest::set_inner(const ContoursView& inner) {
  inner_ = inner;
  if (inner.size() > 0) inner_bands_.build(inner, 1);
}

bool ContainmentTest::certainly_in(const ContoursView& outer) {
  if (inner_.size() == 0) return true;
  if (outer.size() == 0 || inner_bands_.is_crowded()) return false;
  outer_bands_.build(outer, 1);
  if (outer_bands_.is_crowded()) return false;
  for (std::uint32_t c = 0; c < outer.size(); ++c) {
    const std::span<const Point2> points = outer[c];
    if (inner_bands_.inside(points.front())) return false;
    for (std::size_t i = 0; i < points.size(); ++i)
      if (inner_bands_.meets(points[i], points[i + 1 < points.size() ? i + 1 : 0])) return false;
  }
  for (std::uint32_t c = 0; c < inner_.size(); ++c)
    if (!outer_bands_.inside(inner_[c].front())) return false;
  return true;
}

}  // namespace lamina
