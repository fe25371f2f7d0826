// stages/load/diagnosis/side_lists.h: sides of facets, edge by edge; internal to load.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/load/repair/topology.h"

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

}  // namespace lamina::load
