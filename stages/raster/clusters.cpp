#include "stages/raster/clusters.h"

#include "stages/geometry/blocks/block_maker.h"

namespace lamina::raster {

std::vector<ClusteredMesh> make_clusters(std::span<Mesh> meshes, Isa isa) {
  std::vector<std::shared_ptr<MeshBlocks>> blocks = take_blocks(meshes, isa);
  std::vector<ClusteredMesh> clustered;
  clustered.reserve(meshes.size());
  for (std::size_t i = 0; i < meshes.size(); ++i) clustered.emplace_back(std::move(blocks[i]), meshes[i].closed);
  return clustered;
}

}  // namespace lamina::raster
