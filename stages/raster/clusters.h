// stages/raster/clusters.h: a mesh as blocks of 16 neighbouring triangles, the shape that both engines read.
#pragma once

#include <cstdint>

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
class ClusteredMesh {
 public:
  std::uint32_t cluster_count() const { return static_cast<std::uint32_t>(bounds.size()); }

  /// A cluster, where it is stored or expanded into `room`; the reference lives as long as both.
  const Cluster& cluster(std::uint32_t index, [[maybe_unused]] Cluster& room) const { return clusters()[index]; }

  /// One triangle of a cluster, for the few that integers decide.
  Triangle triangle(std::uint32_t cluster, std::uint32_t lane) const { return clusters()[cluster].triangle(lane); }

  /// Asks the processor for the memory that cluster() will read.
  void prefetch(std::uint32_t index) const {
    constexpr std::size_t kLine = 64;
    const char* const bytes = reinterpret_cast<const char*>(&clusters()[index]);
    for (std::size_t line = 0; line < sizeof(Cluster); line += kLine) __builtin_prefetch(bytes + line);
  }

  std::size_t bytes() const { return bytes_held(storage_); }  // of the triangles, without boxes

  Buffer<Box> bounds;           // nm, of each cluster
  std::uint32_t first_cap = 0;  // clusters from here on hold only triangles that repair added
  bool closed = true;           // as Mesh::closed

 private:
  friend ClusteredMesh make_clusters(Mesh& mesh);
  const Cluster* clusters() const { return reinterpret_cast<const Cluster*>(storage_.data()); }

  Buffer<Triangle> storage_;  // whose bytes are the clusters
};

/// Groups the triangles of a mesh into clusters, in place, and takes them out of the mesh.
///
/// Triangles are ordered by height, and among equals by place, within blocks of 4096 of the file's order, each in a core's
/// cache. Clusters are then low: a plane meets few of them, and many facets in each. Most exporters write neighbours near each
/// other; in a file in disorder clusters are wide, but as low as in others. The order has no influence on any image. cost:
/// O(T), parallel; no memory besides the clusters' boxes
ClusteredMesh make_clusters(Mesh& mesh);

}  // namespace lamina::raster
