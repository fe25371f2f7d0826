#include "stages/load/repair/census.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <vector>

#include "stages/load/repair/diagnose.h"

namespace lamina::load {
namespace {

constexpr std::uint64_t kA = 0x2d358dccaa6c78a5, kB = 0x8bb84b93962eacc9, kC = 0x4b33a62ed433d4a3, kD = 0x9e3779b97f4a7c15;

__extension__ using Wide = unsigned __int128;

/// Both halves of the full product: every bit of the result depends on every bit of both factors. (The folded
/// multiplication of Wang Yi, "wyhash", 2019.)
inline std::uint64_t fold(std::uint64_t a, std::uint64_t b) {
  const Wide product = static_cast<Wide>(a) * b;
  return static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64);
}

inline std::uint64_t hash(const Point3& p) {
  const std::uint64_t xy = static_cast<std::uint32_t>(p.x) | std::uint64_t{static_cast<std::uint32_t>(p.y)} << 32;
  return fold(xy ^ kA, (static_cast<std::uint32_t>(p.z) * kD) ^ kB);
}

/// Hash of an edge as walked; depends on the direction.
inline std::uint64_t walked(std::uint64_t from, std::uint64_t to) { return fold(from ^ kC, to ^ kB); }

constexpr std::size_t kMostSampled = std::size_t{1} << 15;

/// Twice the signed area of a facet seen from above, rounded.
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

template <bool kHashes>
inline void add_facets(std::span<const Triangle> facets, std::uint64_t share, CensusSums& sums, std::uint16_t* hashes) {
  const std::uint64_t below = UINT64_MAX / share;
  for (const Triangle& t : facets) {
    const std::uint64_t a = hash(t.a), b = hash(t.b), c = hash(t.c);
    if constexpr (kHashes) {
      for (const std::uint64_t corner : {a, b, c}) *hashes++ = static_cast<std::uint16_t>(corner >> 48);
    }
    const std::uint64_t forward = walked(a, b) + walked(b, c) + walked(c, a);
    const std::uint64_t backward = walked(b, a) + walked(c, b) + walked(a, c);
    sums.boundary += forward - backward;
    sums.fingerprint += fold(forward ^ kA, kD);
    const std::uint64_t unordered = (a + b + c) * kD;
    if (unordered > below || a == b || b == c || c == a) continue;
    sums.sampled.push_back((unordered * kB | 1) ^ ((a < b) ^ (b < c) ^ (c < a) ? 1u : 0u));
  }
}

}  // namespace

void CensusSums::add(std::span<const Triangle> facets, std::uint64_t share, std::uint16_t* hashes) {
  if (hashes == nullptr) {
    add_facets<false>(facets, share, *this, hashes);
  } else {
    add_facets<true>(facets, share, *this, hashes);
  }
}

void CensusSums::add(const CensusSums& other) {
  boundary += other.boundary;
  fingerprint += other.fingerprint;
  sampled.insert(sampled.end(), other.sampled.begin(), other.sampled.end());
}

// One facet in `share` is sampled, chosen by the sum of its corners' hashes.
std::uint64_t sampled_share(std::size_t triangles) { return std::max<std::uint64_t>(1, triangles / kMostSampled); }

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

Prisms Prisms::of(std::span<const Triangle> facets, Nm plane) {
  Prisms sum{0, 0, plane};
  for (const Triangle& t : facets) {
    const double shadow = shadow_of(t);
    sum.doubled_shadow += shadow;
    sum.sixfold_volume += shadow * threefold_height(t, 3.0 * plane);
  }
  return sum;
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
