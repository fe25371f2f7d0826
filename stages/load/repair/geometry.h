// stages/load/repair/geometry.h: exact areas and volumes of facets in nm; internal to load.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "stages/data/mesh.h"

namespace lamina::load {

__extension__ using Int128 = __int128;

/// Twice the facet's area as a vector along its normal; exact.
inline std::array<Int128, 3> doubled_area(const Triangle& t) {
  const auto difference = [](const Point3& p, const Point3& q) {
    return std::array<Int128, 3>{Int128{p.x} - q.x, Int128{p.y} - q.y, Int128{p.z} - q.z};
  };
  const auto u = difference(t.b, t.a), v = difference(t.c, t.a);
  return {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
}

inline bool has_area(const Triangle& t) {
  const auto normal = doubled_area(t);
  return normal[0] != 0 || normal[1] != 0 || normal[2] != 0;
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
  const auto normal = doubled_area(t);
  return normal[0] * (Int128{t.a.x} - from.x) + normal[1] * (Int128{t.a.y} - from.y) + normal[2] * (Int128{t.a.z} - from.z);
}

}  // namespace lamina::load
