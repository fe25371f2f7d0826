#include "stages/raster/clusters.h"

#include "stages/geometry/blocks/block_maker.h"

namespace lamina::raster {

ClusteredMesh make_clusters(Mesh& mesh) { return {take_blocks(mesh), mesh.closed}; }

}  // namespace lamina::raster
