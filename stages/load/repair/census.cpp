#include "stages/load/repair/census.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>

#include "stages/load/repair/diagnose.h"

namespace lamina::load {
namespace {

constexpr std::size_t kMaxSampled = std::size_t{1} << 15;

/// Twice the signed area of a facet projected along z, rounded.
inline double shadow_of(const Triangle& t) {
  const double ax = t.a.x, ay = t.a.y;
  return (t.b.x - ax) * (t.c.y - ay) - (t.c.x - ax) * (t.b.y - ay);
}

/// Three times the height of a facet's middle above a plane, of whose height `below` is three times.
inline double threefold_height(const Triangle& t, double below) { return static_cast<double>(t.a.z) + t.b.z + t.c.z - below; }

struct Sums {
  CensusSums facets;
  double sixfold_volume = 0;  // nm3; its order is fixed by splitting at places that threads do not decide
};

}  // namespace

void CensusSums::add(std::span<const Triangle> facets, std::uint64_t share) {
  const std::uint64_t below = UINT64_MAX / share;
  for (const Triangle& t : facets) add_facet(hash(t.a), hash(t.b), hash(t.c), below, *this);
}

void CensusSums::add(const CensusSums& other) {
  boundary += other.boundary;
  fingerprint += other.fingerprint;
  sampled.insert(sampled.end(), other.sampled.begin(), other.sampled.end());
}

// One facet in `share` is sampled, chosen by the sum of its corners' hashes.
std::uint64_t sampled_share(std::size_t triangles) { return std::max<std::uint64_t>(1, triangles / kMaxSampled); }

bool any_reversed(std::span<const std::uint64_t> sampled) {
  std::size_t size = 64;
  while (size < 2 * sampled.size()) size *= 2;
  std::vector<std::uint64_t> table(size, 0);
  for (const std::uint64_t facet : sampled) {
    std::size_t at = (facet >> 1) & (size - 1);
    for (; table[at] != 0 && table[at] != facet; at = (at + 1) & (size - 1))
      if (table[at] == (facet ^ 1)) return true;
    table[at] = facet;
  }
  return false;
}

Census census(std::span<const Triangle> triangles, Nm plane) {
  const std::uint64_t share = sampled_share(triangles.size());
  const Sums sums = tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, triangles.size(), 1 << 14), Sums{},
      [&](const tbb::blocked_range<std::size_t>& range, Sums so_far) {
        const auto facets = triangles.subspan(range.begin(), range.size());
        for (const Triangle& t : facets) so_far.sixfold_volume += shadow_of(t) * threefold_height(t, 3.0 * plane);
        so_far.facets.add(facets, share);
        return so_far;
      },
      [](Sums one, const Sums& other) {
        one.facets.add(other.facets);
        one.sixfold_volume += other.sixfold_volume;
        return one;
      });
  return {sums.facets.boundary == 0, sums.facets.fingerprint, sums.sixfold_volume / 6e18, any_reversed(sums.facets.sampled)};
}

}  // namespace lamina::load
