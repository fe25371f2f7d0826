// stages/load/repair/enclosed.h: how much a closed mesh encloses, and which of its shells cancel each other; internal to load.
#pragma once

#include <cstdint>

#include "stages/data/mesh.h"

namespace lamina::load {

/// What a mesh encloses, piece by piece: facets that share a vertex, directly or through others, are one piece.
struct Enclosed {
  double volume_mm3 = 0;  // sum over pieces of their volumes without sign
  double area_mm2 = 0;    // of all facets
  /// Half of the volume over half of the area is how far a point is from the surface at best, by order of magnitude. Below
  /// the grid of coordinates, the surface lies upon itself.
  bool nothing() const { return volume_mm3 <= 5e-6 * area_mm2 / 2; }
};

/// cost  O(T log T), 60 bytes a triangle
Enclosed enclosed(const Mesh& mesh);

/// Shells that are in the mesh twice, once inside out: their winding numbers add up to 0, so nothing of them is solid.
struct Cancelled {
  std::uint64_t facets = 0;  // of shells all of whose facets have a reversed twin
  std::uint64_t shells = 0;  // each with its twin
  Box box;                   // around the first
};

/// cost  O(T log T), 100 bytes a triangle
Cancelled find_cancelled(const Mesh& mesh);

}  // namespace lamina::load
