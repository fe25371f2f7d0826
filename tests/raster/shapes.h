// tests/raster/shapes.h: closed solids made of few facets, in nm.
#pragma once

#include <random>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::test {

using Triangles = std::vector<Triangle>;

inline void add_tetrahedron(Triangles& out, Point3 a, Point3 b, Point3 c, Point3 d) {
  out.insert(out.end(), {{a, c, b}, {a, b, d}, {b, c, d}, {c, a, d}});
}

/// Outward facets of an axis-parallel box.
inline Triangles box(Point3 lo, Point3 hi) {
  const auto corner = [&](int k) {
    return Point3{(k & 1) != 0 ? hi.x : lo.x, (k & 2) != 0 ? hi.y : lo.y, (k & 4) != 0 ? hi.z : lo.z};
  };
  Triangles out;
  const int quads[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    out.push_back({corner(q[0]), corner(q[1]), corner(q[2])});
    out.push_back({corner(q[0]), corner(q[2]), corner(q[3])});
  }
  return out;
}

/// A closed height field over n x n cells whose corners are drawn from `pick`; every facet orientation occurs.
template <class Pick>
Triangles random_tetrahedra(int count, Pick&& pick) {
  Triangles out;
  for (int i = 0; i < count; ++i) add_tetrahedron(out, pick(), pick(), pick(), pick());
  return out;
}

inline Triangles reversed(Triangles triangles) {
  for (Triangle& t : triangles) std::swap(t.b, t.c);
  return triangles;
}

inline Triangles moved(Triangles triangles, Point3 by) {
  for (Triangle& t : triangles) {
    for (Point3* p : {&t.a, &t.b, &t.c}) *p = {p->x + by.x, p->y + by.y, p->z + by.z};
  }
  return triangles;
}

inline Mesh make_mesh(const Triangles& triangles) {
  Mesh mesh;
  mesh.triangles.assign(triangles.begin(), triangles.end());
  for (const Triangle& t : triangles) {
    mesh.bounds.add(t.a);
    mesh.bounds.add(t.b);
    mesh.bounds.add(t.c);
  }
  return mesh;
}

}  // namespace lamina::test
