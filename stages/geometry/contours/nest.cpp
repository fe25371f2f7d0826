#include "stages/geometry/contours/nest.h"

#include <algorithm>
#include <cstdlib>
#include <numeric>
#include <tuple>
#include <utility>
#include <vector>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/simplify.h"

namespace lamina {
namespace {

struct Outline {
  Point2 lo{INT32_MAX, INT32_MAX}, hi{INT32_MIN, INT32_MIN};
  Point2 leftmost{};        // the lowest of these
  bool turns_left = false;  // there: a simple contour does so as on the whole
  bool outer = false;       // the same; where that is the tip of a spike, by its area
};

Outline outline_of(std::span<const Point2> points) {
  Outline outline;
  for (const Point2 p : points) {
    outline.lo = {std::min(outline.lo.x, p.x), std::min(outline.lo.y, p.y)};
    outline.hi = {std::max(outline.hi.x, p.x), std::max(outline.hi.y, p.y)};
  }
  const std::size_t n = points.size();
  const std::size_t i = static_cast<std::size_t>(std::min_element(points.begin(), points.end()) - points.begin());
  outline.leftmost = points[i];
  const std::int64_t turn = doubled_area(points[(i + n - 1) % n], points[i], points[(i + 1) % n]);
  outline.turns_left = turn > 0;
  outline.outer = turn == 0 ? doubled_area(points) > 0 : turn > 0;
  return outline;
}

std::vector<Outline> outlines_of(const ContoursView& contours) {
  std::vector<Outline> outlines(contours.size());
  for (std::uint32_t c = 0; c < contours.size(); ++c) outlines[c] = outline_of(contours[c]);
  return outlines;
}

/// Numbers from 0 on, in the order of their keys.
template <class Key>
std::vector<std::uint32_t> sorted_numbers(std::uint32_t count, Key key) {
  std::vector<std::uint32_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0u);
  std::ranges::sort(numbers, {}, key);
  return numbers;
}

/// How often a contour winds about p, which is not on it: signed crossings of the ray towards -x.
std::int32_t winding_about(std::span<const Point2> points, Point2 p) {
  std::int32_t winding = 0;
  Point2 a = points.back();
  for (const Point2 b : points) {
    if ((a.y <= p.y) != (b.y <= p.y)) {
      const std::int64_t area = doubled_area(a, b, p);
      // p is right of an edge that goes down, or of one that goes up.
      if (b.y < a.y && area > 0) ++winding;
      if (b.y > a.y && area < 0) --winding;
    }
    a = b;
  }
  return winding;
}

/// For each contour how often all others wind about it, those of its own group left out.
std::vector<std::int32_t> windings_outside(const Contours& contours, std::span<const Outline> outlines,
                                           const Buffer<std::uint32_t>& group) {
  const std::uint32_t count = contours.size();
  const auto same_group = [&](std::uint32_t a, std::uint32_t b) {
    return !group.empty() && group[a] != kNoContact && group[a] == group[b];
  };
  std::vector<std::int32_t> outside(count, 0);
  std::vector<std::uint32_t> open;  // contours whose box may still reach what comes
  const auto by_left = [&](std::uint32_t c) { return std::pair(outlines[c].lo.x, c); };
  for (const std::uint32_t c : sorted_numbers(count, by_left)) {
    const Outline& own = outlines[c];
    std::erase_if(open, [&](std::uint32_t other) { return outlines[other].hi.x < own.lo.x; });
    for (const std::uint32_t other : open) {
      const Outline& around = outlines[other];
      if (around.lo.y < own.leftmost.y && own.leftmost.y < around.hi.y && !same_group(c, other)) {
        outside[c] += winding_about(contours[other], own.leftmost);
      }
    }
    open.push_back(c);
  }
  return outside;
}

void append(std::span<const Point2> points, bool reversed, Contours& out) {
  if (reversed) {
    out.point.insert(out.point.end(), points.rbegin(), points.rend());
  } else {
    out.point.insert(out.point.end(), points.begin(), points.end());
  }
  out.close();
}

/// The union of the contours of one group about which the others wind `outside` times. Frames around the group represent them;
/// their remains are removed again.
Status group_union(const Contours& contours, std::span<const Outline> outlines, std::uint32_t group_number,
                   const Buffer<std::uint32_t>& group, std::int32_t outside, FillRule rule, Contours& out) {
  constexpr std::int64_t kAway = 1'000'000;
  Contours own;
  Point2 lo{INT32_MAX, INT32_MAX}, hi{INT32_MIN, INT32_MIN};
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    if (group[c] != group_number) continue;
    append(contours[c], false, own);
    lo = {std::min(lo.x, outlines[c].lo.x), std::min(lo.y, outlines[c].lo.y)};
    hi = {std::max(hi.x, outlines[c].hi.x), std::max(hi.y, outlines[c].hi.y)};
  }
  const auto within = [](std::int64_t v) { return static_cast<Nm>(std::clamp<std::int64_t>(v, INT32_MIN, INT32_MAX)); };
  const Point2 a{within(lo.x - kAway), within(lo.y - kAway)}, b{within(hi.x + kAway), within(hi.y + kAway)};
  const Point2 frame[4] = {a, {b.x, a.y}, b, {a.x, b.y}};
  for (std::int32_t i = 0; i < std::abs(outside); ++i) append(frame, outside < 0, own);
  auto merged = contour_union(own, rule);
  if (!merged) return merged.error();
  tidy(*merged);  // edges that contours share may leave spikes
  for (std::uint32_t c = 0; c < merged->size(); ++c) {
    const auto points = (*merged)[c];
    const bool is_frame = std::ranges::any_of(points, [&](Point2 p) { return p.x == a.x || p.x == b.x; });
    if (!is_frame) append(points, false, out);
  }
  return {};
}

constexpr std::uint32_t kNone = UINT32_MAX;

/// 1: inside, 0: on the contour, -1: outside
int position_of(std::span<const Point2> contour, Point2 p) {
  bool inside = false;
  Point2 a = contour.back();
  for (const Point2 b : contour) {
    const std::int64_t area = doubled_area(a, b, p);
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
    if (const int position = position_of(outer, p); position != 0) return position > 0;
  }
  const Point2 a = hole[0], b = hole[1];  // all corners touch: the middle of a side does not
  return position_of(outer, {static_cast<Nm>((std::int64_t{a.x} + b.x) / 2), static_cast<Nm>((std::int64_t{a.y} + b.y) / 2)}) >=
         0;
}

/// For each hole the innermost outer contour around it.
std::vector<std::uint32_t> outers_of(const Contours& contours, const std::vector<Outline>& outlines) {
  const std::uint32_t count = contours.size();
  std::vector<std::uint32_t> open, outer_of(count, kNone);
  // At equal sides an outer contour comes before the holes that touch it there.
  const auto by_left = [&](std::uint32_t c) { return std::tuple(outlines[c].lo.x, !outlines[c].outer, c); };
  for (const std::uint32_t c : sorted_numbers(count, by_left)) {
    const Outline& own = outlines[c];
    std::erase_if(open, [&](std::uint32_t other) { return outlines[other].hi.x < own.lo.x; });
    if (own.outer) {
      open.push_back(c);
      continue;
    }
    // Of nested outer contours the inner one begins further right, and so came later.
    for (auto other = open.rbegin(); other != open.rend() && outer_of[c] == kNone; ++other) {
      const Outline& around = outlines[*other];
      if (around.lo.y <= own.lo.y && own.hi.y <= around.hi.y && own.hi.x <= around.hi.x &&
          is_around(contours[*other], contours[c])) {
        outer_of[c] = *other;
      }
    }
  }
  return outer_of;
}

}  // namespace

Result<std::uint32_t> nest(Contours& contours, FillRule rule, const Buffer<std::uint32_t>& group) {
  const std::uint32_t count = contours.size();
  const std::vector<Outline> outlines = outlines_of(contours);
  const std::vector<std::int32_t> outside = windings_outside(contours, outlines, group);
  // 0: drop, 1: keep, -1: keep reversed
  const auto turn_of = [&](std::uint32_t c) {
    const bool solid_outside = is_solid(rule, outside[c]);
    const bool solid_inside = is_solid(rule, outside[c] + (outlines[c].turns_left ? 1 : -1));
    return solid_inside == solid_outside ? 0 : solid_inside == outlines[c].turns_left ? 1 : -1;
  };
  if (!group.empty()) {
    Contours out;
    std::uint32_t merged = 0;
    for (std::uint32_t c = 0; c < count; ++c) {
      if (group[c] == kNoContact) {
        if (const int turn = turn_of(c); turn != 0) append(contours[c], turn < 0, out);
      } else if (group[c] == c) {
        if (Status status = group_union(contours, outlines, c, group, outside[c], rule, out); !status) return status.error();
        ++merged;
      }
    }
    contours = std::move(out);
    return merged;
  }
  // In place.
  std::uint32_t kept_points = 0, kept_contours = 0, begin = 0;
  for (std::uint32_t c = 0; c < count; ++c) {
    const std::uint32_t end = contours.offset[c + 1];
    if (const int turn = turn_of(c); turn != 0) {
      const auto first = contours.point.begin() + kept_points;
      if (kept_points != begin) std::copy(contours.point.begin() + begin, contours.point.begin() + end, first);
      kept_points += end - begin;
      if (turn < 0) std::reverse(first, contours.point.begin() + kept_points);
      contours.offset[++kept_contours] = kept_points;
    }
    begin = end;
  }
  contours.offset.resize(kept_contours + 1);
  contours.point.resize(kept_points);
  return 0u;
}

bool same_nesting(const Contours& contours, const Contours& others) {
  const std::vector<Outline> outlines = outlines_of(others);
  const std::vector<std::int32_t> outside = windings_outside(others, outlines, {});
  const auto clean = [&](std::uint32_t c) { return outside[c] == (outlines[c].turns_left ? 0 : 1); };
  bool all = true;
  for (std::uint32_t c = 0; c < others.size(); ++c) all = all && clean(c);
  if (all) return true;
  // Contours that touch each other wind otherwise, before as after.
  return outside == windings_outside(contours, outlines_of(contours), {});
}

void order_by_outer(Contours& contours) {
  const std::uint32_t count = contours.size();
  if (count < 2) return;
  const std::vector<Outline> outlines = outlines_of(contours);
  std::uint32_t outers = 0, an_outer = kNone;
  for (std::uint32_t c = 0; c < count; ++c) {
    if (outlines[c].outer) ++outers, an_outer = c;
  }
  if (outers == count || (outers == 1 && an_outer == 0)) return;
  std::vector<std::uint32_t> outer_of =
      outers == 1 ? std::vector<std::uint32_t>(count, an_outer) : outers_of(contours, outlines);
  for (std::uint32_t c = 0; c < count; ++c) {
    if (outlines[c].outer || outer_of[c] == kNone) outer_of[c] = c;
  }
  const auto key = [&](std::uint32_t c) { return std::tuple(outer_of[c], outer_of[c] != c, c); };
  const std::vector<std::uint32_t> order = sorted_numbers(count, key);
  if (std::ranges::is_sorted(order)) return;
  Contours ordered;
  ordered.point.reserve(contours.point.size());
  for (const std::uint32_t c : order) append(contours[c], false, ordered);
  contours = std::move(ordered);
}

bool is_ordered_by_outer(const ContoursView& contours) {
  std::uint32_t outer = kNone;
  Outline around;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const Outline own = outline_of(contours[c]);
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
