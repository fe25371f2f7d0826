// stages/load/repair/diagnose.h: is a mesh closed, and where is it not.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/mesh.h"

namespace lamina::load {

/// What was found; counts, and the first places in file order (at most `places` of each kind).
struct Diagnosis {
  struct FaultPosition {
    std::uint32_t triangle;  // index in the mesh
    Point3 at;               // nm, middle of the edge or first corner of the facet
  };
  struct Finding {
    std::uint64_t count = 0;
    std::vector<FaultPosition> first;
  };
  std::uint64_t triangles = 0, vertices = 0, edges = 0;
  std::uint32_t shells = 0;           // components connected over vertices' edges
  std::uint32_t inverted_shells = 0;  // closed shells with negative volume
  Box bounds;
  double volume_mm3 = 0;       // signed, exact sum rounded once
  double outward_mm3 = 0;      // as if all shells were turned outward
  bool shells_apart = true;    // no boxes of shells overlap, no edge has more than two facets
  std::vector<Nm> shell_ends;  // heights at which shells begin and end, rising; those of the mesh if they are many
  Finding open_edges;          // used by one facet only
  Finding non_manifold_edges;  // used by more than two facets
  Finding misoriented_edges;   // two facets, both in the same direction
  Finding degenerate_facets;   // zero area after snapping
  Finding duplicate_facets;    // same three corners as an earlier facet, in any rotation, same orientation
  /// Every edge is walked as often one way as the other: the winding number is defined everywhere. This, not
  /// manifoldness, is what planning needs.
  bool balanced = false;
};

/// The same for any number of threads. Of findings at one triangle, that at the lowest edge is the first.
/// mesh.bounds  of the list; what is found does not depend on them
/// cost         O(T), parallel; some 30 bytes a triangle, 10 more where neighbours in the mesh are none in the list
Diagnosis diagnose(const Mesh& mesh, std::size_t positions = 3);

/// The same in the memory of the list, for a mesh whose volume alone is read afterwards: the list is empty where that is
/// known without it, because shells lie apart, and as it was where they may overlap.
/// cost: as above; no more memory than the list and a quarter of it, half of it where the list is in disorder
Diagnosis diagnose_alone(Mesh& mesh, std::size_t positions = 3);

/// What every job pays for, in one pass.
struct Census {
  /// Every edge is walked as often one way as the other, up to a chance of 2^-57 that is the same on every machine: the
  /// area that the facets' boundary encloses, with hashes of the vertices as coordinates, is zero.
  bool balanced = false;
  /// Sum over all facets of a hash of their corners, the same for any order of the facets and any first corner.
  /// By which `--resume` verifies that a part is unchanged.
  std::uint64_t fingerprint = 0;
  /// Signed, of the prisms between all facets and a level plane: of the solid if the mesh is balanced, wherever the plane
  /// is; an estimate if it is open and the plane crosses it. Rounded, the same for any number of threads.
  double volume_mm3 = 0;
  /// Some facet was detected in the mesh twice, once turned over: shells may cancel each other (enclosed.h). All facets
  /// are inspected in meshes of up to 32768, a share of them, decided by their corners, in larger ones.
  bool reversed_twins = false;
};

/// plane: its height in nm; within the mesh, so that little cancels out.
/// cost: O(T), parallel, no memory.
Census census(std::span<const Triangle> triangles, Nm plane = 0);

}  // namespace lamina::load
