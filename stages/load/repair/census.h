// stages/load/repair/census.h: the sums of a census and the hashes that they add up, for readers that read a mesh piece by
// piece; internal to load.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::load {

/// Sums over facets that do not depend on their order.
struct CensusSums {
  std::uint64_t boundary = 0;          // 0: every edge is walked as often one way as the other (Census::balanced)
  std::uint64_t fingerprint = 0;       // Census::fingerprint
  std::vector<std::uint64_t> sampled;  // facets without their orientation, which is the lowest bit

  /// share  of sampled_share()
  void add(std::span<const Triangle> facets, std::uint64_t share);
  void add(const CensusSums& other);
};

/// Which share of a mesh's facets is sampled, for CensusSums::add(). triangles  of the whole mesh
std::uint64_t sampled_share(std::size_t triangles);

/// Whether two of the sampled facets differ in orientation alone (Census::reversed_twins).
bool any_reversed(std::span<const std::uint64_t> sampled);

/// Six times the signed volume of the prisms between facets and a level plane, nm3, and twice their signed area projected
/// along z, nm2, by which the volume changes where the plane is another: sums of pieces that were taken at planes of their own.
struct Prisms {
  double sixfold_volume = 0, doubled_shadow = 0;
  Nm plane = 0;  // within the facets or near them, so that little cancels out

  double sixfold_volume_above(Nm other) const {
    return sixfold_volume + 3 * (static_cast<double>(plane) - other) * doubled_shadow;
  }
};

// --- hashes of vertices and facets, whose sums are a census.

inline constexpr std::uint64_t kA = 0x2d358dccaa6c78a5, kB = 0x8bb84b93962eacc9, kC = 0x4b33a62ed433d4a3,
                               kD = 0x9e3779b97f4a7c15;

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

/// Twice the area of the triangle whose corners have the coordinates that the hashes hold, 31 bits each. It is a sum over
/// edges, of which one walked both ways cancels out; the area that walks without their way back enclose is 0 by a chance of
/// 2^-57.
inline std::uint64_t hashed_area(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
  const auto x = [](std::uint64_t h) { return static_cast<std::int64_t>(h & 0x7fffffff); };
  const auto y = [](std::uint64_t h) { return static_cast<std::int64_t>(h >> 33); };
  return static_cast<std::uint64_t>((x(b) - x(a)) * (y(c) - y(a))) - static_cast<std::uint64_t>((x(c) - x(a)) * (y(b) - y(a)));
}

/// The hash of a facet without its orientation by which it is sampled: those up to a bound are. Sums of hashes are as evenly
/// spread as hashes.
inline std::uint64_t unordered(std::uint64_t a, std::uint64_t b, std::uint64_t c) { return a + b + c; }

/// Samples a facet, if it is one.
inline void sample(std::uint64_t a, std::uint64_t b, std::uint64_t c, CensusSums& sums) {
  if (a == b || b == c || c == a) return;
  sums.sampled.push_back((unordered(a, b, c) * kB | 1) ^ ((a < b) ^ (b < c) ^ (c < a) ? 1u : 0u));
}

/// Adds a facet whose corners have these hashes. below  bound of what is sampled
inline void add_facet(std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t below, CensusSums& sums) {
  sums.boundary += hashed_area(a, b, c);
  sums.fingerprint += fold((walked(a, b) + walked(b, c) + walked(c, a)) ^ kA, kD);
  if (unordered(a, b, c) <= below) sample(a, b, c, sums);
}

}  // namespace lamina::load
