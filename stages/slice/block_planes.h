// stages/slice/block_planes.h: which facets of a mesh in blocks a plane crosses, for planes known beforehand.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/interval_table.h"

namespace lamina::slice {

/// Finds the first plane at or above a height: a table of equal steps leads to the place, comparisons decide.
class PlaneFinder {
 public:
  /// planes  strictly increasing; they stay where they are while the finder lives
  explicit PlaneFinder(std::span<const std::int64_t> planes);

  std::uint32_t operator()(std::int64_t z) const {
    if (planes_.empty() || z <= planes_.front()) return 0;
    if (z > planes_.back()) return static_cast<std::uint32_t>(planes_.size());
    std::uint32_t plane = position_[static_cast<std::size_t>(static_cast<std::uint64_t>(z - planes_.front()) >> shift_)];
    while (planes_[plane] < z) ++plane;
    return plane;
  }
  /// The planes that a facet between two heights crosses (loops.h).
  std::pair<std::uint32_t, std::uint32_t> crossed(Nm low, Nm high) const {
    return {(*this)(std::int64_t{low} - kPlaneReach), (*this)(std::int64_t{high} - kPlaneReach)};
  }

 private:
  std::span<const std::int64_t> planes_;
  std::uint32_t shift_ = 0;
  Buffer<std::uint32_t> position_;
};

/// Clusters that are indexed together: neighbours in the file.
inline constexpr std::uint32_t kIndexedTogether = 4;

/// Buffers of a layer, reused.
struct BlockScratch {
  Buffer<std::uint32_t> groups;  // of kIndexedTogether clusters
  Buffer<std::uint32_t> near;    // facets of one block, by their numbers, and
  Buffer<Triangle> crossed;      // those that the plane crosses
  Buffer<std::uint32_t> listed;  // of a block that is not in the order of its file
  Buffer<std::uint8_t> rank;     // of each facet that is found: what it is sorted by

  std::uint64_t bytes() const {
    return bytes_held(groups) + bytes_held(near) + bytes_held(crossed) + bytes_held(listed) + bytes_held(rank);
  }
};

/// A facet of blocks by one number.
inline Triangle facet_of(const MeshBlocks& blocks, std::uint32_t number) {
  return blocks.triangle(number / kClusterSize, number % kClusterSize);
}

/// An index of groups of clusters: 12 bytes for each, where one of facets takes as many for each facet.
class BlockPlanes {
 public:
  /// blocks  with the order of their file, and nothing that repair added; they outlive this
  /// planes  nm, in the frame of the blocks, strictly increasing
  /// cost    O(T), parallel
  BlockPlanes(const MeshBlocks& blocks, std::span<const std::int64_t> planes);
  BlockPlanes(const BlockPlanes&) = delete;
  BlockPlanes& operator=(const BlockPlanes&) = delete;

  /// Calls take(triangles) for the facets that the plane crosses in the order of the file, block by block.
  /// facets  become their numbers for facet_of(), in this order
  /// order   becomes the order in which a PlaneIndex of the file's list finds them, on which all results depend: the n-th one
  ///         is facets[order[n]]
  /// cost    O(F) where vertices are shared
  void find(std::uint32_t plane, BlockScratch& scratch, Buffer<std::uint32_t>& facets, Buffer<std::uint32_t>& order,
            const std::function<void(std::span<const Triangle>)>& take) const;

  std::uint64_t count(std::uint32_t plane) const { return counts_[plane]; }  // of facets that it crosses
  std::uint64_t bytes() const { return table_.bytes() + bytes_held(counts_) + planes_.size() * sizeof(std::int64_t); }

 private:
  bool meets(std::uint32_t cluster, std::int64_t z) const {
    const Box& box = blocks_.bounds()[cluster];
    return !is_above_plane(box.lo.z, z) && is_above_plane(box.hi.z, z);
  }
  void fetch(std::span<const std::uint32_t> groups, std::int64_t z) const;
  void find_near(std::uint32_t group, std::int64_t z, Buffer<std::uint32_t>& near) const;
  void sort_listed(std::uint32_t first, BlockScratch& scratch) const;

  const MeshBlocks& blocks_;
  std::vector<std::int64_t> planes_;
  PlaneFinder first_at_or_above_;
  IntervalTable<std::uint32_t> table_;
  Buffer<std::uint32_t> counts_;
};

}  // namespace lamina::slice
