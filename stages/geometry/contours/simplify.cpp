#include "stages/geometry/contours/simplify.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <span>
#include <utility>

#include "stages/geometry/contours/nest.h"

namespace lamina {
namespace {

using UInt128 = unsigned __int128;

/// floor(sqrt(value)) for value < 2^124.
std::int64_t root(UInt128 value) {
  auto guess = static_cast<UInt128>(std::sqrt(static_cast<double>(value)));
  if (guess > (UInt128{1} << 50)) guess = (guess + value / guess) / 2;  // closer than a double holds
  while (guess * guess > value) --guess;
  while ((guess + 1) * (guess + 1) <= value) ++guess;
  return static_cast<std::int64_t>(guess);
}

/// All points within the tolerance of a stretch. Coordinates of a bed differ by less than 2^31, so products fit 64 bits.
class SegmentTolerance {
 public:
  SegmentTolerance(Point2 a, Point2 b, Nm tolerance) : a_(a), ux_(std::int64_t{b.x} - a.x), uy_(std::int64_t{b.y} - a.y) {
    length2_ = ux_ * ux_ + uy_ * uy_;
    max2_ = std::int64_t{tolerance} * tolerance;
    max_ = root(static_cast<UInt128>(max2_) * static_cast<UInt128>(length2_));
  }

  struct Deviation {
    bool beyond;         // further away than the tolerance
    std::int64_t apart;  // the larger of the distances along and across, times the length of the stretch
  };
  Deviation position(Point2 p) const {
    const std::int64_t vx = std::int64_t{p.x} - a_.x, vy = std::int64_t{p.y} - a_.y;
    const std::int64_t along = ux_ * vx + uy_ * vy, across = std::abs(ux_ * vy - uy_ * vx);
    if (0 <= along && along <= length2_ && length2_ > 0) return {across > max_, across};
    const bool first = along < 0;
    const std::int64_t wx = first ? vx : vx - ux_, wy = first ? vy : vy - uy_;
    return {wx * wx + wy * wy > max2_, std::max(across, first ? -along : along - length2_)};
  }

 private:
  Point2 a_;
  std::int64_t ux_, uy_, length2_, max2_;
  std::int64_t max_;  // across is whole: it is at most tolerance x length if it is at most the root of that squared
};

/// So many checks of each point for every halving of the contour are enough to find the furthest ones; contours of real
/// parts take a quarter of that.
constexpr std::size_t kChecksPerPoint = 8;

/// A contour's points in a circle, and which of them stay.
class Ring {
 public:
  Ring(std::span<const Point2> points, std::uint8_t* kept, Nm tolerance, SimplifyScratch& scratch)
      : points_(points), kept_(kept), tolerance_(tolerance), scratch_(scratch) {}

  /// Marks the points that stay. returns  whether they still enclose an area, on the same side
  bool mark() {
    std::fill_n(kept_, points_.size(), std::uint8_t{0});
    const auto low = static_cast<std::size_t>(std::min_element(points_.begin(), points_.end()) - points_.begin());
    const auto high = static_cast<std::size_t>(std::max_element(points_.begin(), points_.end()) - points_.begin());
    kept_[low] = kept_[high] = 1;
    split(low, high > low ? high : high + points_.size());
    split(high, low > high ? low : low + points_.size());
    collect();
    thin_out();
    return encloses();
  }

 private:
  Point2 at(std::size_t i) const { return points_[i < points_.size() ? i : i - points_.size()]; }

  void split(std::size_t from, std::size_t to) {
    scratch_.open.assign(1, {from, to});
    std::uint64_t inspected = 0;
    const std::uint64_t enough = kChecksPerPoint * (to - from) * static_cast<std::uint64_t>(std::bit_width(to - from));
    while (!scratch_.open.empty()) {
      const auto [first, last] = scratch_.open.back();
      scratch_.open.pop_back();
      inspected += last - first;
      const SegmentTolerance reach(at(first), at(last), tolerance_);
      std::size_t furthest = first;
      std::int64_t maximum = -1;
      bool beyond = false;
      for (std::size_t i = first + 1; i < last; ++i) {
        const SegmentTolerance::Deviation position = reach.position(at(i));
        beyond |= position.beyond;
        if (position.apart > maximum) maximum = position.apart, furthest = i;
      }
      if (!beyond) continue;
      // The teeth of a comb are split off one by one: a segment that was checked often is split near its middle.
      const std::size_t near_end = inspected > enough ? (last - first) / 8 : 0;
      if (furthest - first < near_end || last - furthest < near_end) furthest = first + (last - first) / 2;
      kept_[furthest < points_.size() ? furthest : furthest - points_.size()] = 1;
      scratch_.open.emplace_back(first, furthest);
      scratch_.open.emplace_back(furthest, last);
    }
    scratch_.inspections += inspected;
  }

  void collect() {
    scratch_.index.clear();
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      if (kept_[i] != 0) scratch_.index.push_back(i);
    }
  }

  /// Whether one stretch may stand for the two at `middle`.
  bool needless(std::uint32_t from, std::uint32_t middle, std::uint32_t to) const {
    const SegmentTolerance reach(points_[from], points_[to], tolerance_);
    if (reach.position(points_[middle]).beyond) return false;
    const std::size_t end = to > from ? to : to + points_.size();
    for (std::size_t i = std::size_t{from} + 1; i < end; ++i) {
      if (reach.position(at(i)).beyond) return false;
    }
    return true;
  }

  void thin_out() {
    const auto count = static_cast<std::uint32_t>(scratch_.index.size());
    auto &index = scratch_.index, &next = scratch_.next, &before = scratch_.before;
    next.resize(count);
    before.resize(count);
    for (std::uint32_t k = 0; k < count; ++k) next[k] = k + 1 < count ? k + 1 : 0, before[k] = k > 0 ? k - 1 : count - 1;
    // A point that has to stay does so until a neighbour is removed: the walk steps back after each removal.
    std::uint32_t left = count, passed = 0;
    for (std::uint32_t k = 0; left > 3 && passed < left;) {
      const std::uint32_t b = before[k], n = next[k];
      if (!needless(index[b], index[k], index[n])) {
        ++passed;
        k = n;
        continue;
      }
      const std::uint32_t again = passed + 1 < left ? 1 : 2;  // the one before, and if the walk came round the next one
      kept_[index[k]] = 0;
      next[b] = n;
      before[n] = b;
      --left;
      passed -= std::min(passed, again);
      k = b;
    }
  }

  bool encloses() {
    collect();
    const auto& index = scratch_.index;
    const std::size_t count = index.size();
    if (count < 3) return false;
    __int128 area = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const Point2 a = points_[index[k]], b = points_[index[k + 1 < count ? k + 1 : 0]];
      const Point2 c = points_[index[k + 2 < count ? k + 2 : k + 2 - count]];
      if (doubled_area(a, b, c) == 0) return false;  // a spike: neighbours in contact are not searched
      area += static_cast<__int128>(a.x) * b.y - static_cast<__int128>(b.x) * a.y;
    }
    const __int128 full = doubled_area(points_);
    return area != 0 && (area > 0) == (full > 0);
  }

  std::span<const Point2> points_;
  std::uint8_t* kept_;
  Nm tolerance_;
  SimplifyScratch& scratch_;
};

void gather(const Contours& contours, const Buffer<std::uint8_t>& kept, Contours& out) {
  out.clear();
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    for (std::uint32_t i = contours.offset[c]; i < contours.offset[c + 1]; ++i) {
      if (kept[i] != 0) out.point.push_back(contours.point[i]);
    }
    out.close();
  }
}

}  // namespace

void simplify(Contours& contours, Nm tolerance, SimplifyScratch& scratch) {
  if (tolerance <= 0 || contours.size() == 0) return;
  scratch.kept.resize(contours.point.size());
  scratch.whole.resize(contours.size());
  const auto keep_whole = [&](std::uint32_t c) {
    scratch.whole[c] = 1;
    std::fill(scratch.kept.begin() + contours.offset[c], scratch.kept.begin() + contours.offset[c + 1], std::uint8_t{1});
  };
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    scratch.whole[c] = 0;
    const bool suffices =
        contours[c].size() > 3 && Ring(contours[c], scratch.kept.data() + contours.offset[c], tolerance, scratch).mark();
    if (!suffices) keep_whole(c);
  }
  // Contours that became whole again may meet others that did not.
  for (bool again = true; again;) {
    again = false;
    gather(contours, scratch.kept, scratch.thinned);
    if (!find_contacts(scratch.thinned, scratch.contact, scratch.group)) break;
    for (std::uint32_t c = 0; c < contours.size(); ++c) {
      if (scratch.group[c] == kNoContact || scratch.whole[c] != 0) continue;
      keep_whole(c);
      again = true;
    }
  }
  if (same_nesting(contours, scratch.thinned)) std::swap(contours, scratch.thinned);
}

namespace {

constexpr double kRounding = 1;  // nm that a new point may be off

struct EdgeVector {
  double x, y;
};
EdgeVector from_to(Point2 a, Point2 b) { return {static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y}; }
double cross(EdgeVector a, EdgeVector b) { return a.x * b.y - a.y * b.x; }

/// The point for both ends of bc, between a and d.
Point2 merged(Point2 a, Point2 b, Point2 c, Point2 d) {
  const EdgeVector before = from_to(a, b), own = from_to(b, c), after = from_to(c, d);
  const double first = cross(before, own), second = cross(own, after), both = cross(before, after);
  EdgeVector by{own.x / 2, own.y / 2};
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
    const EdgeVector own = from_to(b, c);
    const bool first_stays = i + 1 < count;  // the seam's edge would need the point that was written first
    if (left > 4 && first_stays && own.x * own.x + own.y * own.y < shortest * shortest) {
      const Point2 a = out.point.size() > begin ? out.point.back() : points.back();
      const Point2 d = points[i + 2 < count ? i + 2 : i + 2 - count];
      const Point2 p = merged(a, b, c, d);
      if (distance_to(p, b, c) <= tolerance && distance_to(b, a, p) <= tolerance && distance_to(c, p, d) <= tolerance) {
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

namespace {

/// Moves the points of [begin, end) that matter to `out`, which may be `begin`; returns how many those are.
std::size_t drop_straight(const Point2* begin, const Point2* end, Point2* out) {
  std::size_t size = 0;
  for (const Point2* p = begin; p != end; ++p) {
    const Point2 point = *p;  // `out` may reach it
    while (size > 0) {
      if (out[size - 1] == point || (size > 1 && doubled_area(out[size - 2], out[size - 1], point) == 0)) {
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
    if (out[size - 1] == out[first] || doubled_area(out[size - 2], out[size - 1], out[first]) == 0) {
      --size;
    } else if (doubled_area(out[size - 1], out[first], out[first + 1]) == 0) {
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
