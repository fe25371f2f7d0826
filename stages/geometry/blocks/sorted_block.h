// stages/geometry/blocks/sorted_block.h: a block while it is made, in the order in which it will be stored.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/mesh.h"
#include "stages/geometry/blocks/cluster.h"

namespace lamina {

/// At most kBlockSize triangles as clusters, and a hash of each corner: what each step of making a block reads from a core's
/// cache, coordinate by coordinate. Unused lanes of the last cluster hold the first corner of the last triangle. 168 KiB.
struct alignas(64) SortedBlock {
  static constexpr std::uint32_t kCorners = 3 * kClusterSize;  // of a cluster; corner k of triangle i is k * kClusterSize + i

  std::array<Cluster, kBlockSize / kClusterSize> cluster;
  std::array<std::uint16_t, 3 * kBlockSize> hash;  // cluster by cluster; equal where vertices are
  std::uint32_t triangles = 0;

  std::uint32_t clusters() const { return (triangles + kClusterSize - 1) / kClusterSize; }

  /// Takes at least one triangle; order[i] is the i-th of them.
  void take(std::span<const Triangle> list, std::span<const std::uint16_t> order);
  /// Hashes by itself, where no caller does.
  void hash_corners();
};

}  // namespace lamina
