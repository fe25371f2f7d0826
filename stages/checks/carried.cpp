#include "stages/checks/carried.h"

#include <cmath>
#include <cstdlib>
#include <vector>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/nest.h"

namespace lamina::checks {
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

void append_reversed(std::span<const Point2> contour, Contours& to) {
  to.point.insert(to.point.end(), contour.rbegin(), contour.rend());
  to.close();
}

}  // namespace

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

bool RegionBelow::has(std::span<const Point2> contour) const {
  const auto first = [&](std::uint32_t c) { return contours[c].front(); };
  auto it = std::ranges::lower_bound(by_start, contour.front(), {}, first);
  for (; it != by_start.end() && first(*it) == contour.front(); ++it) {
    if (std::ranges::equal(contours[*it], contour)) return true;
  }
  return false;
}

namespace {

/// Whether a hole in the next layer goes around all points of a hole that are beyond the reach from it: it is within the reach
/// of the hole's contour, and encloses more than all such points do, so it goes around as the contour does.
bool stays_open(std::span<const Point2> hole, const PlanarBox& box, std::span<const Point2> next, const PlanarBox& next_box,
                std::int64_t reach) {
  const auto near = [&](Nm a, Nm b) { return std::abs(std::int64_t{a} - b) < reach; };
  if (!near(box.lo.x, next_box.lo.x) || !near(box.lo.y, next_box.lo.y) || !near(box.hi.x, next_box.hi.x) ||
      !near(box.hi.y, next_box.hi.y)) {
    return false;
  }
  double length = 0;
  for (std::size_t i = 0; i < hole.size(); ++i) {
    const Point2 a = hole[i], b = hole[i + 1 < hole.size() ? i + 1 : 0];
    length += std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
  }
  const double around = 4 * static_cast<double>(reach) * (length + static_cast<double>(reach));  // twice, as is the area
  if (-static_cast<double>(doubled_area(next)) <= around) return false;
  const std::uint32_t offset[2] = {0, static_cast<std::uint32_t>(hole.size())};
  EdgeBands bands;
  bands.build({offset, hole}, reach);
  for (std::size_t i = 0; i < next.size(); ++i) {
    if (!bands.carries(next[i], next[i + 1 < next.size() ? i + 1 : 0], static_cast<double>(reach - 1), false)) return false;
  }
  return true;
}

/// The holes below that are wider than twice the reach and not known to stay open, and what is in them, inside out.
Contours wide_gaps(const RegionBelow& below, const ContoursView& own, std::int64_t reach) {
  RegionBelow above;  // its contours alone are needed
  above.contours = own;
  std::vector<PlanarBox> islands, wide;
  for (std::uint32_t c = 0; c < own.size(); ++c) {
    above.box.push_back(box_around(own[c]));
    above.by_start.push_back(c);
    if (doubled_area(own[c]) > 0) islands.push_back(above.box.back());
  }
  Buffer<std::uint32_t> by_left = above.by_start;
  const auto left = [&](std::uint32_t c) { return above.box[c].lo.x; };
  std::ranges::sort(by_left, {}, left);
  std::ranges::sort(above.by_start, {}, [&](std::uint32_t c) { return own[c].front(); });
  Contours gaps;
  for (std::uint32_t c = 0; c < below.contours.size(); ++c) {
    const std::span<const Point2> points = below.contours[c];
    const PlanarBox& box = below.box[c];
    if (std::min(std::int64_t{box.hi.x} - box.lo.x, std::int64_t{box.hi.y} - box.lo.y) <= 2 * reach) continue;
    if (doubled_area(points) >= 0) continue;
    const PlanarBox larger = grown(box, reach);
    const auto island = [&](const PlanarBox& other) { return is_within(other, larger); };
    bool open = above.has(points);
    for (auto it = std::ranges::lower_bound(by_left, larger.lo.x, {}, left); !open && it != by_left.end(); ++it) {
      if (left(*it) > box.lo.x + reach) break;
      open = stays_open(points, box, own[*it], above.box[*it], reach);
    }
    if (open && std::ranges::none_of(islands, island)) continue;
    wide.push_back(box);
    append_reversed(points, gaps);
  }
  const std::uint32_t holes = gaps.size();
  for (std::uint32_t c = 0; c < below.contours.size() && holes > 0; ++c) {
    const std::span<const Point2> points = below.contours[c];
    if (doubled_area(points) <= 0) continue;
    for (std::uint32_t h = 0; h < holes; ++h) {
      if (!is_within(below.box[c], wide[h]) || !is_inside(gaps[h], points.front())) continue;
      append_reversed(points, gaps);
      break;
    }
  }
  return gaps;
}

}  // namespace

Point2 point_within(const ContoursView& component) {
  const PlanarBox box = box_around(component[0]);
  const Nm y = static_cast<Nm>(box.lo.y + (std::int64_t{box.hi.y} - box.lo.y) / 2);
  std::vector<double> crossings;
  for (std::uint32_t c = 0; c < component.size(); ++c) {
    const std::span<const Point2> points = component[c];
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point2 a = points[i], b = points[i + 1 < points.size() ? i + 1 : 0];
      if ((a.y <= y) == (b.y <= y)) continue;
      crossings.push_back(a.x +
                          (static_cast<double>(b.x) - a.x) * (static_cast<double>(y) - a.y) / (static_cast<double>(b.y) - a.y));
    }
  }
  std::ranges::sort(crossings);
  double widest = -1;
  Point2 at = component[0].front();
  for (std::size_t i = 0; i + 1 < crossings.size(); i += 2) {
    if (crossings[i + 1] - crossings[i] <= widest) continue;
    widest = crossings[i + 1] - crossings[i];
    at = {static_cast<Nm>(std::llround((crossings[i] + crossings[i + 1]) / 2)), y};
  }
  return at;
}

bool shares_area(const ContoursView& component, const RegionBelow& below) {
  if (below.has(component[0])) return true;
  const Point2 deep = point_within(component);
  if (below.bands.inside(deep) && !below.bands.touches(deep)) return true;
  constexpr std::size_t kTried = 8;  // points of a contour; those on edges decide nothing
  const auto any_of = [](std::span<const Point2> points, auto&& is_in) {
    const std::size_t step = std::max<std::size_t>(1, points.size() / kTried);
    for (std::size_t i = 0; i < points.size(); i += step)
      if (is_in(points[i])) return true;
    return false;
  };
  if (any_of(component[0], [&](Point2 p) { return below.bands.inside(p) && !below.bands.touches(p); })) return true;
  const PlanarBox around = box_around(component[0]);
  EdgeBands own;
  own.build(component, 2);
  for (std::uint32_t c = 0; c < below.contours.size(); ++c) {
    if (!around.meets(below.box[c])) continue;
    if (any_of(below.contours[c], [&](Point2 p) { return own.inside(p) && !own.touches(p); })) return true;
  }
  return false;
}

Status RegionBelow::prepare(const ContoursView& below, const ContoursView& own, std::int64_t reach) {
  contours = below;
  box.clear();
  uncarried.clear();
  uncarried_box.clear();
  by_start.clear();
  for (std::uint32_t c = 0; c < below.size(); ++c) {
    box.push_back(box_around(below[c]));
    by_start.push_back(c);
  }
  std::ranges::sort(by_start, {}, [&](std::uint32_t c) { return below[c].front(); });
  bands.build(below, reach);
  Contours gaps = wide_gaps(*this, own, reach);
  if (gaps.size() == 0) return {};
  order_by_outer(gaps);
  const auto rest = offset_contours(gaps, -reach);
  if (!rest) return rest.error();
  for (std::uint32_t c = 0; c < rest->size(); ++c) {
    if (doubled_area((*rest)[c]) <= 0) continue;
    uncarried.push_back((*rest)[c].front());
    uncarried_box.push_back(box_around((*rest)[c]));
  }
  return {};
}

void find_uncarried(const ContoursView& component, const RegionBelow& below, std::int64_t reach,
                    std::vector<PlanarBox>& boxes) {
  for (std::uint32_t c = 0; c < component.size(); ++c) {
    const std::span<const Point2> points = component[c];
    if (below.has(points)) continue;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Point2 a = points[i], b = points[i + 1 < points.size() ? i + 1 : 0];
      if (below.bands.carries(a, b, static_cast<double>(reach))) continue;
      PlanarBox& box = boxes.emplace_back();
      box.add(a), box.add(b);
    }
  }
  for (std::size_t i = 0; i < below.uncarried.size(); ++i) {
    if (is_inside(component, below.uncarried[i])) boxes.push_back(below.uncarried_box[i]);
  }
}

}  // namespace lamina::checks
