// stages/raster/clusters.h: a mesh as blocks of 16 neighbouring triangles, the shape that both engines read.
#pragma once

#include <cstdint>

#include "stages/data/buffer.h"
#include "stages/data/mesh.h"

namespace lamina::raster {

inline constexpr std::uint32_t kClusterSize = 16;

/// 16 triangles, coordinate by coordinate, so that one plane is compared with 16 facets at a time. Corner k of
/// triangle i is (x[k][i], y[k][i], z[k][i]), nm, frame of the mesh. Unused lanes hold a point, which no plane crosses.
struct alignas(64) Cluster {
  Nm z[3][kClusterSize];
  Nm y[3][kClusterSize];
  Nm x[3][kClusterSize];
};
static_assert(sizeof(Cluster) == 576);

/// A mesh in clusters: 36 bytes a triangle, like the list it was made from.
struct ClusteredMesh {
  Buffer<Cluster> clusters;
  Buffer<Box> bounds;            // nm, of each cluster
  std::uint32_t first_cap = 0;   // clusters from here on hold only triangles that repair added
};

/// Groups the triangles of a mesh into clusters and frees them there.
///
/// Triangles are ordered along a Morton curve of their middles (G. M. Morton 1966), unless the file's own order
/// already gives clusters nearly as small, which many exporters' does. The order has no influence on any image.
/// cost: O(T), parallel; 16 bytes a triangle for sorting on top of the mesh and its clusters.
ClusteredMesh make_clusters(Mesh& mesh);

}  // namespace lamina::raster
