// stages/raster/clusters.h: a mesh as blocks of 16 neighbouring triangles, the shape that both engines read.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::raster {

inline constexpr std::uint32_t kClusterSize = 16;

/// 16 triangles, coordinate by coordinate, so that one plane is compared with 16 facets at a time. Corner k of
/// triangle i is (x[k][i], y[k][i], z[k][i]), nm, frame of the mesh. Unused lanes hold a point, which no plane crosses.
struct alignas(16) Cluster {
  Nm z[3][kClusterSize];
  Nm y[3][kClusterSize];
  Nm x[3][kClusterSize];

  Triangle triangle(std::uint32_t lane) const {
    return {{x[0][lane], y[0][lane], z[0][lane]}, {x[1][lane], y[1][lane], z[1][lane]}, {x[2][lane], y[2][lane], z[2][lane]}};
  }
};
static_assert(sizeof(Cluster) == kClusterSize * sizeof(Triangle));

/// A mesh in clusters: 36 bytes a triangle, in the memory of the list that it was made from.
struct ClusteredMesh {
  Buffer<Triangle> storage;  // whose bytes are the clusters; moves with its heap block, so `clusters` stays valid
  std::span<const Cluster> clusters;
  Buffer<Box> bounds;           // nm, of each cluster
  std::uint32_t first_cap = 0;  // clusters from here on hold only triangles that repair added
  bool closed = true;           // as Mesh::closed
};

/// Groups the triangles of a mesh into clusters, in place, and takes them out of the mesh.
///
/// Triangles are ordered by height, and among equals by place, within blocks of 4096 of the file's order, each in a core's
/// cache. Clusters are then low: a plane meets few of them, and many facets in each. Most exporters write neighbours near each
/// other; in a file in disorder clusters are wide, but as low as in others. The order has no influence on any image. cost:
/// O(T), parallel; no memory besides the clusters' boxes
ClusteredMesh make_clusters(Mesh& mesh);

}  // namespace lamina::raster
