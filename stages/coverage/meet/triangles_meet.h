// stages/coverage/meet/triangles_meet.h: whether two facets meet anywhere but in corners and edges that they share.
#pragma once

#include <cstdint>

#include "stages/data/mesh.h"

namespace lamina::coverage {

/// A facet and its doubled area normal, which is exact where corners differ by less than 2^31 nm.
struct Plane {
  Triangle facet;
  std::int64_t nx, ny, nz;

  Plane() = default;
  explicit Plane(const Triangle& t);
  bool flat() const { return nx == 0 && ny == 0 && nz == 0; }  // no area
};

/// True if they do; also where they come too near for doubles to decide. Both have area.
/// shared  corners that both have
/// Source: separating axes of convex bodies (S. Gottschalk, 1996); coplanar and touching ones are decided in integers
bool triangles_meet(const Plane& f, const Plane& g, int& shared);

}  // namespace lamina::coverage
