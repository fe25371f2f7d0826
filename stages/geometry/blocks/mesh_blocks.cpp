#include "stages/geometry/blocks/mesh_blocks.h"

#include <algorithm>

namespace lamina {
namespace {

std::uint32_t clusters_for(std::uint32_t triangles) { return (triangles + kClusterSize - 1) / kClusterSize; }
std::uint32_t blocks_for(std::uint32_t triangles) { return (triangles + kBlockSize - 1) / kBlockSize; }
std::uint64_t bytes_of_bounds(std::uint32_t clusters) { return clusters * std::uint64_t{sizeof(Box)} + 63; }

/// No block takes more than its clusters do as they are read.
static_assert(sizeof(IndexedCluster) + kClusterSize * 3 / 2 * sizeof(Point3) + 4 + 63 <= sizeof(Cluster));
std::uint64_t max_bytes(std::uint32_t triangles) { return clusters_for(triangles) * std::uint64_t{sizeof(Cluster)}; }

}  // namespace

MeshBlocks::MeshBlocks(std::uint32_t own, std::uint32_t added)
    : own_(own),
      added_(added),
      first_cap_(clusters_for(own)),
      first_cap_block_(blocks_for(own)),
      pages_(max_bytes(own) + max_bytes(added) + bytes_of_bounds(clusters_for(own) + clusters_for(added))) {
  blocks_.resize(std::size_t{first_cap_block_} + blocks_for(added));
  const std::uint32_t clusters = first_cap_ + clusters_for(added);
  bounds_ = {reinterpret_cast<Box*>(pages_.take(clusters * sizeof(Box))), clusters};
  bounds_taken_ = pages_.bytes();
}

std::uint32_t MeshBlocks::triangles_in(std::uint32_t block) const {
  const std::uint32_t end = block < first_cap_block_ ? own_ : own_ + added_;
  return std::min(kBlockSize, end - first_triangle(block));
}

void MeshBlocks::shift(const Point3& by) {
  const auto move = [&](Point3& p) { p = {p.x + by.x, p.y + by.y, p.z + by.z}; };
  for (Block& block : blocks_) {
    block.step_0 += by.z;
    auto* const vertex = const_cast<Point3*>(block.vertex());
    for (std::uint32_t v = 0; v < block.vertices; ++v) move(vertex[v]);
    for (std::uint32_t c = 0; block.vertices == 0 && c < block.clusters; ++c) {
      auto& cluster = reinterpret_cast<Cluster*>(block.bytes)[c];
      for (std::uint32_t k = 0; k < 3; ++k) {
        for (Nm& x : cluster.x[k]) x += by.x;
        for (Nm& y : cluster.y[k]) y += by.y;
        for (Nm& z : cluster.z[k]) z += by.z;
      }
    }
  }
  for (Box& box : bounds_) {
    move(box.lo);
    move(box.hi);
  }
}

}  // namespace lamina
