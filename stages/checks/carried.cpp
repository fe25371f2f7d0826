#include "stages/checks/carried.h"

#include <cmath>
#include <vector>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/nest.h"

namespace lamina::checks {
namespace {

void append_reversed(std::span<const Point2> contour, Contours& to) {
  to.point.insert(to.point.end(), contour.rbegin(), contour.rend());
  to.close();
}

}  // namespace

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
