// stages/load/repair/census.cpp: whether a mesh is closed, and which mesh it is, in one pass without sorting.
#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

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
};

}  // namespace

Census census(std::span<const Triangle> triangles) {
  const Sums sums = tbb::parallel_reduce(
      tbb::blocked_range<std::size_t>(0, triangles.size(), 1 << 14), Sums{},
      [&](const tbb::blocked_range<std::size_t>& range, Sums so_far) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          const std::uint64_t a = hash(triangles[i].a), b = hash(triangles[i].b), c = hash(triangles[i].c);
          const std::uint64_t forward = walked(a, b) + walked(b, c) + walked(c, a);
          const std::uint64_t backward = walked(b, a) + walked(c, b) + walked(a, c);
          so_far.boundary += forward - backward;
          so_far.fingerprint += fold(forward ^ kA, kD);
        }
        return so_far;
      },
      [](const Sums& one, const Sums& other) {
        return Sums{one.boundary + other.boundary, one.fingerprint + other.fingerprint};
      });
  return {sums.boundary == 0, sums.fingerprint};
}

}  // namespace lamina::load
