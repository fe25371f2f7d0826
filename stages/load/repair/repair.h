// stages/load/repair/repair.h: makes the winding number of an open mesh defined everywhere, and says how.
#pragma once

#include <cstdint>

#include "stages/data/mesh.h"
#include "stages/load/repair/weld.h"

namespace lamina::load {

struct RepairReport {
  std::uint64_t duplicates_dropped = 0;
  std::uint64_t facets_turned = 0;
  std::uint64_t vertices_welded = 0;
  std::int64_t weld_nm = 0;          // the largest distance that closed something
  double weld_moved_mm3 = 0;         // what welding moved each facet by, as volumes, added up as errors by chance do
  std::uint64_t sheets_dropped = 0;  // surfaces attached to a solid that enclosed nothing
  std::uint64_t sheet_facets_dropped = 0;
  std::uint64_t flat_dropped = 0;  // pieces that lie in a plane, and so enclose nothing
  std::uint64_t flat_facets_dropped = 0;
  double volume_before_mm3 = 0;       // an estimate (census), before flat pieces were dropped and openings capped
  std::uint64_t openings_capped = 0;  // loops of unmatched edges
  std::uint64_t cap_triangles = 0;
  double largest_opening_mm = 0;  // largest box diagonal of one loop
  Box largest_opening;            // around that loop
};

/// Repairs a mesh that is not balanced (diagnose.h), in this order, each step only while the mesh is unbalanced:
///  1. a facet that repeats an earlier one (same corners, same orientation) is dropped;
///  2. open edges that were meant to be one are joined, over growing distances (weld.h has the rule);
///  3. facets are turned over so that neighbours across two-facet edges agree; per connected component the
///     orientation of the larger area wins; undone if it would leave more unmatched than before;
///  4. stray sheets, attached to a solid with a rim that is open, and loose flat pieces are dropped (repair.cpp has
///     the rules);
///  5. the edges that are still unmatched are walked into loops, smallest first come, and each loop is capped with a
///     fan of triangles from its smallest vertex.
/// After step 5 every edge is balanced, for any input: the boundary of a chain of triangles is a set of cycles,
/// and a fan over a cycle has exactly that cycle, reversed, as its boundary. So no row of any layer can stay open.
/// A missing triangle is restored exactly, a planar hole is filled exactly. Caps are appended after the mesh's own
/// triangles (Mesh::repaired_from), so that later stages can report the rows that they decide.
///
/// The result does not depend on threads. A balanced mesh is returned untouched. mesh.bounds is kept up to date,
/// mesh.fingerprint is not.
/// cost  a balanced mesh: one pass; else O(T log T), about 150 bytes a triangle on top of the mesh while it works
///
/// caps  false: only the first three steps, for callers that close the mesh otherwise
RepairReport repair(Mesh& mesh, const WeldRange& weld, bool caps = true);

/// Turns every facet over if the mesh is closed and its volume negative. Keeps mesh.volume_mm3 and mesh.fingerprint right,
/// both of which must be up to date. The nonzero rule plans the same before and after.
/// returns  whether it was inside out
bool turn_over_if_inside_out(Mesh& mesh);

/// Area of the triangles from mesh.repaired_from on over the area of all; 0 for a mesh without area.
/// cost     O(T) where there are any, else nothing
double capped_share(const Mesh& mesh);

}  // namespace lamina::load
