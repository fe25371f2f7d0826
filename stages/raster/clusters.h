// stages/raster/clusters.h: a mesh as clusters of 16 neighbouring triangles, the shape that both engines read.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "stages/data/mesh.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/isa.h"

namespace lamina::raster {

using lamina::Cluster;
using lamina::kClusterSize;

/// A mesh in clusters, however they are stored; copies share them.
class ClusteredMesh {
 public:
  ClusteredMesh(std::shared_ptr<const MeshBlocks> blocks, bool is_closed)
      : bounds(blocks->bounds()), first_cap(blocks->first_cap()), closed(is_closed), blocks_(std::move(blocks)) {}

  std::uint32_t cluster_count() const { return static_cast<std::uint32_t>(bounds.size()); }

  /// A cluster, where it is stored or expanded into `room`; the reference lives as long as both.
  const Cluster& cluster(std::uint32_t index, Cluster& unpacked) const { return blocks_->cluster(index, unpacked); }

  /// What names a cluster's corners, or the cluster itself (mesh_blocks.h).
  MeshBlocks::Indexed indexed(std::uint32_t index) const { return blocks_->indexed(index); }
  const Cluster& listed(std::uint32_t index) const { return blocks_->listed(index); }

  /// One triangle of a cluster, for the few that integers decide.
  Triangle triangle(std::uint32_t cluster, std::uint32_t lane) const { return blocks_->triangle(cluster, lane); }

  /// The memory that indexed() or listed() points to.
  std::span<const char> stored(std::uint32_t index) const { return blocks_->stored(index); }

  std::uint64_t bytes() const { return blocks_->bytes(); }  // of the triangles
  std::uint64_t bounds_bytes() const { return blocks_->bounds_bytes(); }

  std::span<const Box> bounds;  // nm, of each cluster
  std::uint32_t first_cap;      // clusters from here on hold only triangles that repair added
  bool closed;                  // as Mesh::closed

 private:
  std::shared_ptr<const MeshBlocks> blocks_;
};

/// Groups the triangles of meshes into clusters and takes them out of the meshes (block_maker.h).
/// cost: O(T), parallel; nothing where the loader has made blocks
std::vector<ClusteredMesh> make_clusters(std::span<Mesh> meshes, Isa isa = Isa::kAuto);
inline ClusteredMesh make_clusters(Mesh& mesh, Isa isa = Isa::kAuto) { return make_clusters(std::span(&mesh, 1), isa).front(); }

}  // namespace lamina::raster
