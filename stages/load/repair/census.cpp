// stages/load/repair/census.cpp: whether a mesh is closed, which mesh it is and how large, in one pass without sorting.
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

struct Sums {
  std::uint64_t boundary = 0, fingerprint = 0;  // sums modulo 2^64 do not depend on their order
  double sixfold_volume = 0;                    // nm3; its order is fixed by splitting at places that threads do not decide
  std::vector<std::uint64_t> sampled;           // facets without their orientation, which is the lowest bit
};

constexpr std::size_t kMostSampled = std::size_t{1} << 15;

/// Whether two of the sampled facets differ in orientation alone. A full table forgets nothing: it is at most half full.
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

/// Six times the signed volume of the prism between a facet and a plane, of whose height `below` is three times; rounded.
inline double sixfold_volume(const Triangle& t, double below) {
  const double ax = t.a.x, ay = t.a.y;
  const double area = (t.b.x - ax) * (t.c.y - ay) - (t.c.x - ax) * (t.b.y - ay);
  return area * (static_cast<double>(t.a.z) + t.b.z + t.c.z - below);
}

}  // namespace

Census census(std::span<const Triangle> triangles, Nm plane) {
  // One facet in `share` is sampled, chosen by the sum of its corners' hashes.
  const std::uint64_t share = std::max<std::uint64_t>(1, triangles.size() / kMostSampled);
  const std::uint64_t below = UINT64_MAX / share;
  const Sums sums = tbb::parallel_deterministic_reduce(
      tbb::blocked_range<std::size_t>(0, triangles.size(), 1 << 14), Sums{},
      [&](const tbb::blocked_range<std::size_t>& range, Sums so_far) {
        const auto facets = triangles.subspan(range.begin(), range.size());
        for (const Triangle& t : facets) so_far.sixfold_volume += sixfold_volume(t, 3.0 * plane);  // apart: registers are few
        for (const Triangle& t : facets) {
          const std::uint64_t a = hash(t.a), b = hash(t.b), c = hash(t.c);
          const std::uint64_t forward = walked(a, b) + walked(b, c) + walked(c, a);
          const std::uint64_t backward = walked(b, a) + walked(c, b) + walked(a, c);
          so_far.boundary += forward - backward;
          so_far.fingerprint += fold(forward ^ kA, kD);
          const std::uint64_t unordered = (a + b + c) * kD;
          if (unordered > below || a == b || b == c || c == a) continue;
          so_far.sampled.push_back((unordered * kB | 1) ^ ((a < b) ^ (b < c) ^ (c < a) ? 1u : 0u));
        }
        return so_far;
      },
      [](Sums one, const Sums& other) {
        one.boundary += other.boundary;
        one.fingerprint += other.fingerprint;
        one.sixfold_volume += other.sixfold_volume;
        one.sampled.insert(one.sampled.end(), other.sampled.begin(), other.sampled.end());
        return one;
      });
  return {sums.boundary == 0, sums.fingerprint, sums.sixfold_volume / 6e18, any_reversed(sums.sampled)};
}

}  // namespace lamina::load
