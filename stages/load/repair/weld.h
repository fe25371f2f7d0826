// stages/load/repair/weld.h: open edges that were meant to be one; internal to load.
#pragma once

#include <cstdint>

#include "stages/load/repair/topology.h"

namespace lamina::load {

/// Distances to try one after the other: start, twice that, and so on up to `most`; 0 joins nothing.
struct WeldRange {
  std::int64_t start_nm = 0, max_nm = 0;
  WeldRange(std::int64_t only_nm) : WeldRange(only_nm, only_nm) {}  // NOLINT: a distance is a range
  WeldRange(std::int64_t start, std::int64_t maximum) : start_nm(start), max_nm(maximum) {}
};

struct Welding {
  std::uint64_t joined = 0;      // vertices that became one with another
  std::int64_t distance_nm = 0;  // the largest distance that was tried and closed something
};

/// Joins vertices at open edges (edges with one facet) and moves them to the middle of those that become one. What is
/// joined are edges, not points, nearest first:
///  - two open edges whose ends lie within the distance become one; opposite directions before equal ones;
///  - then the end of an open edge joins that of another which runs back along it, as at a vertex that only one side has.
/// An edge is joined once. Refused, because it would harm what is sound: ends further apart than half of the shortest
/// edge at either; facets that would lose a corner; vertices spread wider than the distance; facets that lie upon each
/// other, such as the two sides of a wall (unless they are too small against the distance to decide).
///
/// Distances grow until no edge is open. A distance after which edges with more than two facets grow by more than an
/// eighth of what it closes, or that closes nothing, is undone; the former ends the search.
///
/// mesh    facets and positions are changed; positions are then no longer in order: index again
/// sides   of mesh.facet, sorted; kept up to date
/// cost    per distance O(T) and the sorting of sides; parallel where it searches
Welding weld(Indexed& mesh, Buffer<Side>& sides, const WeldRange& range);

/// Half of the longest of all edges that are the shortest at a vertex, nm, rounded up: vertices further apart than this are
/// never joined, at any distance.
std::int64_t farthest_weld(const Indexed& mesh);

}  // namespace lamina::load
