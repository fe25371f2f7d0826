// stages/load/repair/topology.h: which corners are the same vertex, and which facets meet at an edge; internal to load.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::load {

/// A mesh with shared vertices.
struct Indexed {
  using Facet = std::array<std::uint32_t, 3>;
  Buffer<Point3> vertex;  // strictly increasing in lexicographic order, so indices compare as points do
  Buffer<Facet> facet;    // indices into vertex, in the order of the triangles
};

/// cost  O(T log T), parallel; 60 bytes a triangle, 24 of them kept
Indexed index_mesh(std::span<const Triangle> triangles);

/// One facet's side, with what it needs to be sorted next to the others on the same edge.
struct Side {
  std::uint32_t low, high;  // vertices of the edge, low < high
  std::uint32_t facet;
  bool forward;  // walked from low to high
};

/// All sides, by edge and then by facet; sides of facets that use a vertex twice are left out, because they cancel out.
/// cost  O(T log T), parallel; 48 bytes a triangle
Buffer<Side> sorted_sides(std::span<const Indexed::Facet> facets);

inline bool collapsed(const Indexed::Facet& facet) {
  return facet[0] == facet[1] || facet[1] == facet[2] || facet[2] == facet[0];
}

/// Calls visit(begin, end) for the sides of each edge.
template <class Visit>
void for_each_edge(std::span<const Side> sides, const Visit& visit) {
  for (std::size_t begin = 0; begin < sides.size();) {
    std::size_t end = begin + 1;
    while (end < sides.size() && sides[end].low == sides[begin].low && sides[end].high == sides[begin].high) ++end;
    visit(sides.data() + begin, sides.data() + end);
    begin = end;
  }
}

/// How much more often the edge is walked from low to high than back.
inline std::int64_t surplus(const Side* begin, const Side* end) {
  std::int64_t sum = 0;
  for (const Side* side = begin; side != end; ++side) sum += side->forward ? 1 : -1;
  return sum;
}

/// For each facet, whether an earlier one has the same corners in the same orientation.
/// cost  O(T log T), parallel; 16 bytes a triangle
Buffer<std::uint8_t> repeats(std::span<const Indexed::Facet> facets);

/// Facets in sets that are joined one by one, by several threads at a time if need be: each set's representative is its
/// smallest member, in any order of joining.
/// source  R. J. Anderson, H. Woll, "Wait-free parallel algorithms for the union-find problem", STOC 1991
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count);
  std::uint32_t find(std::uint32_t member);
  void join(std::uint32_t one, std::uint32_t other);
  /// Ancestors of members, none larger than its member: representatives are their own. For when all are joined.
  std::span<std::uint32_t> parents() { return parent_; }

 private:
  Buffer<std::uint32_t> parent_;
};

}  // namespace lamina::load
