#include "stages/geometry/contours/simplify.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <span>

#include "stages/geometry/contours/nest.h"

namespace lamina {
namespace {

using UInt128 = unsigned __int128;

std::int64_t area_of(Point2 a, Point2 b, Point2 c) {
  return (std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - b.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - b.x);
}

/// floor(sqrt(value)) for value < 2^124.
std::int64_t root(UInt128 value) {
  auto guess = static_cast<UInt128>(std::sqrt(static_cast<double>(value)));
  if (guess > (UInt128{1} << 50)) guess = (guess + value / guess) / 2;  // closer than a double holds
  while (guess * guess > value) --guess;
  while ((guess + 1) * (guess + 1) <= value) ++guess;
  return static_cast<std::int64_t>(guess);
}

/// All points within the tolerance of a stretch. Coordinates of a bed differ by less than 2^31, so products fit 64 bits.
class Reach {
 public:
  Reach(Point2 a, Point2 b, Nm tolerance) : a_(a), ux_(std::int64_t{b.x} - a.x), uy_(std::int64_t{b.y} - a.y) {
    length2_ = ux_ * ux_ + uy_ * uy_;
    most2_ = std::int64_t{tolerance} * tolerance;
    most_ = root(static_cast<UInt128>(most2_) * static_cast<UInt128>(length2_));
  }

  struct Place {
    bool beyond;         // further away than the tolerance
    std::int64_t apart;  // the larger of the distances along and across, times the length of the stretch
  };
  Place place(Point2 p) const {
    const std::int64_t vx = std::int64_t{p.x} - a_.x, vy = std::int64_t{p.y} - a_.y;
    const std::int64_t along = ux_ * vx + uy_ * vy, across = std::abs(ux_ * vy - uy_ * vx);
    if (0 <= along && along <= length2_ && length2_ > 0) return {across > most_, across};
    const bool first = along < 0;
    const std::int64_t wx = first ? vx : vx - ux_, wy = first ? vy : vy - uy_;
    return {wx * wx + wy * wy > most2_, std::max(across, first ? -along : along - length2_)};
  }

 private:
  Point2 a_;
  std::int64_t ux_, uy_, length2_, most2_;
  std::int64_t most_;  // across is whole: it is at most tolerance x length if it is at most the root of that squared
};

/// So many looks at each point for every halving of the contour are enough for the furthest ones to be taken; contours of real
/// parts take a quarter of that.
constexpr std::size_t kLooksAPoint = 8;

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
    scratch_.index.clear();
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      if (kept_[i] != 0) scratch_.index.push_back(i);
    }
    thin_out();
    return encloses();
  }

 private:
  Point2 at(std::size_t i) const { return points_[i < points_.size() ? i : i - points_.size()]; }

  void split(std::size_t from, std::size_t to) {
    scratch_.open.assign(1, {from, to});
    std::uint64_t looked_at = 0;
    const std::uint64_t enough = kLooksAPoint * (to - from) * static_cast<std::uint64_t>(std::bit_width(to - from));
    while (!scratch_.open.empty()) {
      const auto [first, last] = scratch_.open.back();
      scratch_.open.pop_back();
      looked_at += last - first;
      const Reach reach(at(first), at(last), tolerance_);
      std::size_t furthest = first;
      std::int64_t most = -1;
      bool beyond = false;
      for (std::size_t i = first + 1; i < last; ++i) {
        const Reach::Place place = reach.place(at(i));
        beyond |= place.beyond;
        if (place.apart > most) most = place.apart, furthest = i;
      }
      if (!beyond) continue;
      // The teeth of a comb are split off one by one: a stretch that has been looked at often is split near its middle.
      const std::size_t near_end = looked_at > enough ? (last - first) / 8 : 0;
      if (furthest - first < near_end || last - furthest < near_end) furthest = first + (last - first) / 2;
      kept_[furthest < points_.size() ? furthest : furthest - points_.size()] = 1;
      scratch_.open.emplace_back(first, furthest);
      scratch_.open.emplace_back(furthest, last);
    }
    scratch_.looks += looked_at;
  }

  /// Whether one stretch may stand for the two at `middle`.
  bool needless(std::uint32_t from, std::uint32_t middle, std::uint32_t to) const {
    const Reach reach(points_[from], points_[to], tolerance_);
    if (reach.place(points_[middle]).beyond) return false;
    const std::size_t end = to > from ? to : to + points_.size();
    for (std::size_t i = std::size_t{from} + 1; i < end; ++i) {
      if (reach.place(at(i)).beyond) return false;
    }
    return true;
  }

  void thin_out() {
    const auto count = static_cast<std::uint32_t>(scratch_.index.size());
    auto &index = scratch_.index, &next = scratch_.next, &before = scratch_.before;
    next.resize(count);
    before.resize(count);
    for (std::uint32_t k = 0; k < count; ++k) next[k] = k + 1 < count ? k + 1 : 0, before[k] = k > 0 ? k - 1 : count - 1;
    // A point that has to stay has to until one beside it goes: the walk steps back after each that does.
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
    scratch_.index.clear();
    for (std::uint32_t i = 0; i < points_.size(); ++i) {
      if (kept_[i] != 0) scratch_.index.push_back(i);
    }
    const auto& index = scratch_.index;
    const std::size_t count = index.size();
    if (count < 3) return false;
    __int128 area = 0;
    for (std::size_t k = 0; k < count; ++k) {
      const Point2 a = points_[index[k]], b = points_[index[k + 1 < count ? k + 1 : 0]];
      const Point2 c = points_[index[k + 2 < count ? k + 2 : k + 2 - count]];
      if (area_of(a, b, c) == 0) return false;  // a spike: neighbours in contact are not looked for
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
    const bool stands =
        contours[c].size() > 3 && Ring(contours[c], scratch.kept.data() + contours.offset[c], tolerance, scratch).mark();
    if (!stands) keep_whole(c);
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

}  // namespace lamina
