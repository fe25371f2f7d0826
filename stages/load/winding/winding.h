// stages/load/winding/winding.h: the generalized winding number of facets that do not close, and the closed surface that it
// gives in their place; internal to load.
//
// source  Jacobson, Kavan, Sorkine-Hornung, "Robust Inside-Outside Segmentation using Generalized Winding Numbers" (2013);
//         Barill, Dickson, Schmidt, Levin, Jacobson, "Fast Winding Numbers for Soups and Clouds" (2018);
//         van Oosterom, Strackee, "The Solid Angle of a Plane Triangle" (1983)
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/load/transform.h"

namespace lamina::load {

/// Facets in a tree of boxes; what is far away counts as one dipole.
class WindingTree {
 public:
  using Point = Vector;  // nm from `origin`

  /// cost  O(T log T), 100 bytes a triangle
  WindingTree(std::span<const Triangle> triangles, const Point3& origin);

  /// The solid angle of all facets from a point, over that of a sphere: 1 within a closed outward surface, 0 outside,
  /// in between near openings. Within some hundredths. Safe from any thread.
  /// inspected  boxes and facets that it took are added to it, if given
  double at(const Point& point, std::uint64_t* inspected = nullptr) const;

  /// Whether the box of any facet meets a box; nm from `origin`.
  bool meets(const Point& lo, const Point& hi) const;

 private:
  struct Node {
    Point centre{}, normal{};  // of all facets by area; normal is their sum, half of its length the area, nm2
    double radius = 0;         // around the centre, nm
    std::uint32_t begin = 0, end = 0, second = 0;  // facets; the first child follows, the second is there; 0 for leaves
  };
  struct Corners {
    Point a, b, c;
  };
  std::uint32_t build(std::uint32_t begin, std::uint32_t end);

  Buffer<Corners> facets_;
  Buffer<Node> nodes_;
};

/// Replaces the triangles by the surface on which the winding number is a half in size, within a thirtieth of a cell where
/// facets are, found on a grid of so many cells along the longest side. Closed, for any facets. mesh.bounds
/// follow, mesh.fingerprint does not.
///
/// returns  the size of a cell in mm: smaller features are lost
/// source  marching tetrahedra: Doi, Koide (1991)
/// cost    some seconds; 100 bytes a triangle and some 50 MB. The same for any number of threads.
double remesh(Mesh& mesh, int cells = 128);

}  // namespace lamina::load
