// stages/load/repair/geometry.h: exact areas and volumes of facets in nm; internal to load.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "stages/data/mesh.h"

namespace lamina::load {

__extension__ using Int128 = __int128;

/// Calls use(normal) with twice the facet's area as a vector along its normal; exact. Its numbers have 64 bits where the facet
/// is less than 1.07 m long, and 128 elsewhere.
template <class Use>
auto with_doubled_area(const Triangle& t, const Use& use) {
  using Whole = std::array<std::int64_t, 3>;
  const auto difference = [](const Point3& p, const Point3& q) {
    return Whole{std::int64_t{p.x} - q.x, std::int64_t{p.y} - q.y, std::int64_t{p.z} - q.z};
  };
  const auto cross = []<class Number>(const std::array<Number, 3>& u, const std::array<Number, 3>& v) {
    return std::array<Number, 3>{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  };
  const Whole u = difference(t.b, t.a), v = difference(t.c, t.a);
  // Products of two numbers of at most 2^30 and a sign, and differences of these, have 62 bits. One test serves all six: a
  // number is within if, 2^30 added, it has no bit above the lowest 31.
  constexpr std::int64_t kMax = std::int64_t{1} << 30;
  const std::int64_t bits = (u[0] + kMax) | (u[1] + kMax) | (u[2] + kMax) | (v[0] + kMax) | (v[1] + kMax) | (v[2] + kMax);
  if (bits >> 31 == 0) [[likely]]
    return use(cross(u, v));
  return use(cross(std::array<Int128, 3>{u[0], u[1], u[2]}, std::array<Int128, 3>{v[0], v[1], v[2]}));
}

/// Twice the facet's area as a vector along its normal; exact.
inline std::array<Int128, 3> doubled_area(const Triangle& t) {
  return with_doubled_area(t, [](const auto& normal) { return std::array<Int128, 3>{normal[0], normal[1], normal[2]}; });
}

/// The normal's numbers modulo 2^64 take no branch; where one of them is not 0, neither is what it is the rest of.
inline bool has_area(const Triangle& t) {
  const auto off = [](Nm to, Nm from) { return static_cast<std::uint64_t>(std::int64_t{to} - from); };
  const std::uint64_t ux = off(t.b.x, t.a.x), uy = off(t.b.y, t.a.y), uz = off(t.b.z, t.a.z);
  const std::uint64_t vx = off(t.c.x, t.a.x), vy = off(t.c.y, t.a.y), vz = off(t.c.z, t.a.z);
  if (((uy * vz - uz * vy) | (uz * vx - ux * vz) | (ux * vy - uy * vx)) != 0) [[likely]]
    return true;
  return with_doubled_area(t, [](const auto& normal) { return normal[0] != 0 || normal[1] != 0 || normal[2] != 0; });
}

/// Length of the vector, nm2; for comparisons that may be rounded.
inline double doubled_area_length(const Triangle& t) {
  const auto normal = doubled_area(t);
  const double x = static_cast<double>(normal[0]), y = static_cast<double>(normal[1]), z = static_cast<double>(normal[2]);
  return std::sqrt(x * x + y * y + z * z);
}

inline double diagonal_nm(const Box& box) {
  const auto width = static_cast<double>(box.width()), depth = static_cast<double>(box.depth()),
             height = static_cast<double>(box.height());
  return std::sqrt(width * width + depth * depth + height * height);
}

/// Six times the volume between the facet and a point; exact. Below 2^101, so 2^26 facets add up in 128 bits; sums
/// over more facets stay within them as long as the volume itself is that of a body within reach.
inline Int128 sixfold_volume(const Triangle& t, const Point3& from) {
  const std::int64_t x = std::int64_t{t.a.x} - from.x, y = std::int64_t{t.a.y} - from.y, z = std::int64_t{t.a.z} - from.z;
  return with_doubled_area(
      t, [&](const auto& normal) { return Int128{normal[0]} * x + Int128{normal[1]} * y + Int128{normal[2]} * z; });
}

}  // namespace lamina::load
