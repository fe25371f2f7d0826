// stages/geometry/blocks/vertex_numbers.h: the vertices of a block, each once, and numbers for its corners.
#pragma once

#include "stages/geometry/blocks/kernels/kernels.h"

namespace lamina {

/// Numbers the vertices of one block after the other, in scratch memory of its own, which stays in a core's cache.
class VertexNumbers {
 public:
  /// Numbers vertices in the order in which clusters name them. returns  whether there are at most 1.5 a triangle
  /// cost  O(T) where hashes are of many values; no branch depends on whether a corner is a new vertex
  bool number(const SortedBlock& block, const BlockKernels& kernels);

  std::uint32_t count() const { return count_; }
  /// Of each corner, in the shape of the clusters: IndexedCluster::corner.
  const std::uint16_t* corners() const { return matches_.number.data(); }
  /// For BlockKernels::write.
  const CornerMatches& matches() const { return matches_; }

 private:
  void match_again(const SortedBlock& block);
  void match_rest(const SortedBlock& block);

  CornerMatches matches_;
  std::uint32_t count_ = 0;
};

}  // namespace lamina
