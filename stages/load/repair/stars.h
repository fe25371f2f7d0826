// stages/load/repair/stars.h: the edges of a mesh, found among the facets around each vertex; internal to load.
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {

/// The three vertices of a facet, rising, and whether it names them in that order (or a rotation of it).
struct Rising {
  std::uint32_t low, mid, high;
  bool forward;
};
inline Rising rising(const Indexed::Facet& facet) {
  std::uint32_t a = facet[0], b = facet[1], c = facet[2];
  bool forward = true;
  if (a > b) std::swap(a, b), forward = !forward;
  if (b > c) std::swap(b, c), forward = !forward;
  if (a > b) std::swap(a, b), forward = !forward;
  return {a, b, c, forward};
}

/// Sorts the sides of edges with one lower vertex by edge and then by facet.
void sort_sides(std::span<Side> sides);

/// Of some facets, those that an earlier one of them has the same corners as, in the same orientation; each once, in no order.
/// A facet that uses a vertex twice has no orientation. facets: is overwritten
std::vector<std::uint32_t> repeats_among(const Numbered& mesh, std::vector<std::uint32_t>& facets);

/// Lists of facets, one a vertex: those of which it is the lowest or the middle vertex, in rising order. Every edge starts
/// from its lower vertex, so its facets are all in one list. Of facets that use a vertex twice, the lowest lists them.
class Stars {
 public:
  /// mesh  outlives it
  /// cost  O(T), one thread; 8 bytes a triangle and 4 a vertex kept
  explicit Stars(const Numbered& mesh);

  std::uint32_t vertices() const { return static_cast<std::uint32_t>(begin_.size() - 1); }
  std::span<const std::uint32_t> of(std::uint32_t vertex) const {
    return {facets_.data() + begin_[vertex], begin_[vertex + 1] - begin_[vertex]};
  }

  /// The sides of those edges whose lower vertex this is, by edge and then by facet; facets that use a vertex twice are
  /// left out, because their sides cancel out. sides: is overwritten
  /// returns  whether any was left out
  bool sides_of(std::uint32_t vertex, Buffer<Side>& sides) const;

  /// Appends those facets of which this is the lowest vertex that an earlier facet has the same corners as, in the same
  /// orientation; each once.
  void repeats_of(std::uint32_t vertex, std::vector<std::uint32_t>& repeats) const;

 private:
  const Numbered& mesh_;
  Buffer<std::uint32_t> begin_;  // of each vertex, and the end
  Buffer<std::uint32_t> facets_;
};

}  // namespace lamina::load
