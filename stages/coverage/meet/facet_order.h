// stages/coverage/meet/facet_order.h: facets of a mesh in groups that lie near each other, and which groups touch a box.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/coverage/meet/facet_group.h"
#include "stages/data/buffer.h"
#include "stages/geometry/blocks/mesh_blocks.h"

namespace lamina::coverage {

/// Facets with area along a curve through their middles, sixteen a group, regardless of the file's order; and a tree of sixteen
/// boxes a node over the groups. 4 bytes a facet and 2 of boxes, 20 more while it is made.
///
/// Source: G. Morton's order (1966); each bit of it halves the cell's longest side
class FacetOrder {
 public:
  /// cost  O(T), parallel but for the sort
  FacetOrder(const MeshBlocks& mesh, const PairKernels& kernels);

  std::uint32_t groups() const { return static_cast<std::uint32_t>((facet_.size() + kGroupSize - 1) / kGroupSize); }
  /// Facets of a group, numbered cluster * kClusterSize + lane.
  std::span<const std::uint32_t> facets(std::uint32_t group) const {
    const std::size_t first = std::size_t{group} * kGroupSize;
    return {facet_.data() + first, std::min<std::size_t>(kGroupSize, facet_.size() - first)};
  }
  const Box& box(std::uint32_t group) const { return box_[group]; }

  /// Calls `see` with each group whose box touches the box, in rising order.
  template <class See>
  void each(const Box& box, See&& see) const {
    if (!levels_.empty()) visit(levels_.size() - 1, 0, box, see);
  }

 private:
  template <class See>
  void visit(std::size_t level, std::uint32_t node, const Box& box, See&& see) const {
    for (std::uint32_t touch = kernels_.touching(levels_[level][node], box); touch != 0; touch &= touch - 1) {
      const std::uint32_t child = node * kGroupSize + static_cast<std::uint32_t>(std::countr_zero(touch));
      if (level == 0) {
        see(child);
      } else {
        visit(level - 1, child, box, see);
      }
    }
  }
  void sort(const MeshBlocks& mesh);
  void bound(const MeshBlocks& mesh);

  const PairKernels& kernels_;
  Buffer<std::uint32_t> facet_;
  Buffer<Box> box_;
  std::vector<std::vector<BoxLanes>> levels_;  // [0]: boxes of groups
};

}  // namespace lamina::coverage
