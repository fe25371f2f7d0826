#include "stages/slice/cut.h"

#include <algorithm>

namespace lamina::slice {
namespace {

std::uint64_t hash_of(const Point3& p) {
  const auto word = [](Nm v) { return static_cast<std::uint64_t>(static_cast<std::uint32_t>(v)); };
  std::uint64_t h = (word(p.x) | word(p.y) << 32) * 0x9E3779B97F4A7C15ull;
  h ^= h >> 29;
  return (h + word(p.z)) * 0xBF58476D1CE4E5B9ull;
}

std::uint64_t hash_of(std::uint64_t low, std::uint64_t high) {
  const std::uint64_t h = (low ^ (high >> 31) ^ (high << 33)) * 0x94D049BB133111EBull;
  return h ^ (h >> 32);
}

/// from + the share num / den of the way to `to`, rounded; 0 <= num < den.
Nm exact_between(Nm from, Nm to, std::int64_t num, std::int64_t den) {
  const __int128 way = static_cast<__int128>(std::int64_t{to} - from) * num * 2 + den;
  return static_cast<Nm>(from + static_cast<std::int64_t>(floor_div<__int128>(way, static_cast<__int128>(den) * 2)));
}

/// The product of two doubles that are each off by at most 2^-53 of themselves, for ways below 2^31, then one addition: off by
/// less than 2^-19. Whatever lies near a half is decided in integers.
Nm between(Nm from, Nm to, double share, std::int64_t num, std::int64_t den) {
  constexpr double kNear = 0x1p-17, kPositive = 0x1p32;
  const double way = share * static_cast<double>(std::int64_t{to} - from) + 0.5 + kPositive;
  const auto whole = static_cast<std::int64_t>(way);
  const double rest = way - static_cast<double>(whole);
  if (rest < kNear || rest > 1 - kNear) [[unlikely]]
    return exact_between(from, to, num, den);
  return static_cast<Nm>(from + whole - static_cast<std::int64_t>(kPositive));
}

}  // namespace

Point2 crossing(const Edge& edge, std::int64_t z) {
  const std::int64_t num = z - edge.low.z, den = std::int64_t{edge.high.z} - edge.low.z;
  const double share = static_cast<double>(num) / static_cast<double>(den);
  return {between(edge.low.x, edge.high.x, share, num, den), between(edge.low.y, edge.high.y, share, num, den)};
}

void cut(std::span<const Triangle> triangles, std::span<const std::uint32_t> facets, std::int64_t z, Cuts& cuts) {
  constexpr std::size_t kAhead = 16;  // facets lie anywhere in memory: asked for before they are needed
  const std::size_t count = facets.size();
  cuts.from.resize(count);
  cuts.to.resize(count);
  cuts.from_hash.resize(count);
  cuts.to_hash.resize(count);
  cuts.at.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (i + kAhead < count) {
      const auto* next = reinterpret_cast<const char*>(&triangles[facets[i + kAhead]]);
      __builtin_prefetch(next);
      __builtin_prefetch(next + sizeof(Triangle) - 1);
    }
    const Point3* corner = &triangles[facets[i]].a;
    const bool a = corner[0].z > z, b = corner[1].z > z, c = corner[2].z > z;
    // The tip is alone on its side; the plane cuts the two edges that start there.
    const std::uint32_t tip = a == b ? 2 : a == c ? 1 : 0;
    const Point3& own = corner[tip];
    const Point3& next = corner[tip == 2 ? 0 : tip + 1];
    const Point3& previous = corner[tip == 0 ? 2 : tip - 1];
    const std::uint64_t own_hash = hash_of(own), next_hash = hash_of(next), previous_hash = hash_of(previous);
    if (own.z > z) {
      cuts.from[i] = {next, own};
      cuts.to[i] = {previous, own};
      cuts.from_hash[i] = hash_of(next_hash, own_hash);
      cuts.to_hash[i] = hash_of(previous_hash, own_hash);
    } else {
      cuts.from[i] = {own, previous};
      cuts.to[i] = {own, next};
      cuts.from_hash[i] = hash_of(own_hash, previous_hash);
      cuts.to_hash[i] = hash_of(own_hash, next_hash);
    }
    cuts.at[i] = crossing(cuts.from[i], z);
  }
}

namespace {

/// Finds the first plane at or above a height: a table of equal steps leads to the place, comparisons decide.
class PlaneFinder {
 public:
  explicit PlaneFinder(std::span<const std::int64_t> planes) : planes_(planes) {
    if (planes.empty()) return;
    const auto range = static_cast<std::uint64_t>(planes.back() - planes.front());
    while ((range >> shift_) > 4 * planes.size()) ++shift_;
    position_.resize(static_cast<std::size_t>(range >> shift_) + 1);
    std::uint32_t plane = 0;
    for (std::size_t cell = 0; cell < position_.size(); ++cell) {
      while (planes[plane] < planes.front() + static_cast<std::int64_t>(cell << shift_)) ++plane;
      position_[cell] = plane;
    }
  }

  std::uint32_t operator()(std::int64_t z) const {
    if (planes_.empty() || z <= planes_.front()) return 0;
    if (z > planes_.back()) return static_cast<std::uint32_t>(planes_.size());
    std::uint32_t plane = position_[static_cast<std::size_t>(static_cast<std::uint64_t>(z - planes_.front()) >> shift_)];
    while (planes_[plane] < z) ++plane;
    return plane;
  }

 private:
  std::span<const std::int64_t> planes_;
  std::uint32_t shift_ = 0;
  Buffer<std::uint32_t> position_;
};

}  // namespace

PlaneIndex index_crossings(std::span<const Triangle> triangles, std::span<const std::int64_t> planes) {
  const PlaneFinder first_at_or_above(planes);
  return {0, static_cast<std::int64_t>(planes.size()) - 1, 0, [&](auto use) {
            for (std::uint32_t facet = 0; facet < triangles.size(); ++facet) {
              const Triangle& t = triangles[facet];
              const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
              const std::uint32_t first = first_at_or_above(low), last = first_at_or_above(high);
              if (first < last) use({first, last, facet});
            }
          }};
}

}  // namespace lamina::slice
