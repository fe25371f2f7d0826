#include "stages/geometry/travel/inside_route.h"

#include <algorithm>
#include <cmath>

namespace lamina::travel {
namespace {

constexpr std::size_t kMaxCrossings = 64;  // of a straight line that is replaced; more of them would make too long a route
constexpr std::int64_t kGrid = 1000;       // nm: routes turn at whole micrometres, which files contain
constexpr std::size_t kAhead = 8;          // points that may be left out where an inset folds over

Point2 between(Point2 a, Point2 b, double share) {
  return {static_cast<Nm>(std::llround(a.x + share * (static_cast<double>(b.x) - a.x))),
          static_cast<Nm>(std::llround(a.y + share * (static_cast<double>(b.y) - a.y)))};
}

}  // namespace

/// Adds a point moved to the left of two edges, which is inside: by inset_, at most twice that at a corner.
void InsideRoute::add_inset(Point2 at, std::uint32_t edge, std::uint32_t other) {
  double x = 0, y = 0, cosine = 0;
  double last_x = 0, last_y = 0;
  for (const std::uint32_t e : {edge, other}) {
    const Point2 a = region_->from(e), b = region_->to(e);
    const double length = std::max(1.0, length_nm(a, b));
    const double nx = -(static_cast<double>(b.y) - a.y) / length, ny = (static_cast<double>(b.x) - a.x) / length;
    cosine = nx * last_x + ny * last_y;
    x += nx, y += ny;
    last_x = nx, last_y = ny;
  }
  const double scale = inset_ / std::max(0.5, 1 + cosine);
  const auto whole = [](double nm) { return static_cast<Nm>(kGrid * std::llround(nm / kGrid)); };
  long_way_.push_back({whole(at.x + x * scale), whole(at.y + y * scale)});
}

/// Adds the shorter way along the contour between the points of two of its edges. returns  false if both are too long
bool InsideRoute::follow(std::uint32_t leaves, Point2 from, std::uint32_t enters, Point2 to) {
  const double limit = 2 * detour_ + length_nm(from, to);  // corners that are cut make it shorter
  const auto measure = [&](bool forward, double maximum) {
    double way = 0;
    Point2 at = from;
    for (std::uint32_t e = leaves; e != enters && way <= maximum;) {
      const Point2 corner = forward ? region_->to(e) : region_->from(e);
      way += length_nm(at, corner);
      at = corner;
      e = forward ? region_->next(e) : region_->before(e);
    }
    return way + length_nm(at, to);
  };
  const double onwards = measure(true, limit), back = measure(false, std::min(limit, onwards));
  if (std::min(onwards, back) > limit) return false;
  const bool forward = onwards <= back;
  add_inset(from, leaves, leaves);
  for (std::uint32_t e = leaves; e != enters;) {
    const std::uint32_t other = forward ? region_->next(e) : region_->before(e);
    add_inset(forward ? region_->to(e) : region_->from(e), e, other);
    e = other;
  }
  add_inset(to, enters, enters);
  return true;
}

/// The straight line, with every part of it outside replaced by a way along a contour.
bool InsideRoute::follow_contours(Point2 a, Point2 b) {
  region_->crossings(a, b, crossing_);
  const std::size_t count = crossing_.size();
  if (count > kMaxCrossings || count % 2 != 0) return false;
  long_way_.clear();
  long_way_.push_back(a);
  for (std::size_t i = 0; i < count; ++i) {  // crossings 0, 2, ... lead out
    const std::uint32_t contour = region_->contour_of(crossing_[i].edge);
    std::size_t last = count - 1;
    while (last > i && region_->contour_of(crossing_[last].edge) != contour) last -= std::min<std::size_t>(last, 2);
    if (last <= i) return false;
    if (!follow(crossing_[i].edge, between(a, b, crossing_[i].at), crossing_[last].edge, between(a, b, crossing_[last].at)))
      return false;
    i = last;
  }
  long_way_.push_back(b);
  return true;
}

/// Leaves out the points that the route does not need. returns  false if some of it would touch a contour
bool InsideRoute::cut_corners() {
  const std::size_t last = long_way_.size() - 1;
  for (std::size_t at = 0; at < last;) {
    const auto is_free = [&](std::size_t to) { return !region_->crosses(long_way_[at], long_way_[to]); };
    std::size_t next = at + 1;
    while (next <= std::min(last, at + kAhead) && !is_free(next)) ++next;
    if (next > std::min(last, at + kAhead)) return false;
    std::size_t step = 1;
    for (; next + step <= last && is_free(next + step); step *= 2) next += step;
    for (step = std::min(step, last - next); step > 0; step /= 2) {
      if (next + step <= last && is_free(next + step)) next += step;
    }
    if (is_free(last)) next = last;
    route_.push_back(long_way_[next]);
    at = next;
  }
  return true;
}

const Buffer<Point2>& InsideRoute::find(Point2 a, Point2 b) {
  route_.clear();
  if (!region_->contains(a)) return route_;
  if (!region_->crosses(a, b)) {
    route_.push_back(b);
    return route_;
  }
  if (!(detour_ > 0) || !follow_contours(a, b) || !cut_corners()) {
    route_.clear();
    return route_;
  }
  double way = 0;
  Point2 at = a;
  for (const Point2 p : route_) way += length_nm(std::exchange(at, p), p);
  if (way > length_nm(a, b) + detour_) route_.clear();
  return route_;
}

}  // namespace lamina::travel
