// stages/load/diagnosis/side_lists.h: sides of facets, edge by edge; internal to load.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/load/repair/topology.h"
#include "stages/load/repair/vertices.h"

namespace lamina::load {

/// Sides by their lower vertex: a list a vertex, each in the order of edges and then of facets.
class SideLists {
 public:
  /// cost  O(V + S) and sorting each list; 16 bytes a side and 4 a vertex
  SideLists(std::uint32_t vertices, std::span<const Buffer<Side>> sides);

  std::span<const Side> of(std::uint32_t vertex) const {
    return {sides_.data() + begin_[vertex], begin_[vertex + 1] - begin_[vertex]};
  }

 private:
  Buffer<std::uint32_t> begin_;  // of each vertex, and the end
  Buffer<Side> sides_;
};

// --- facets that a mesh has twice; internal to load.

/// Of some facets, those that an earlier one of them in the list has the same corners as, in the same orientation; each once,
/// in no order. A facet that uses a vertex twice has no orientation. facets: is overwritten
std::vector<std::uint32_t> repeats_among(const Numbered& mesh, std::vector<std::uint32_t>& facets);

}  // namespace lamina::load
