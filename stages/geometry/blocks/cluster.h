// stages/geometry/blocks/cluster.h: 16 neighbouring triangles, the shape that every kernel reads.
#pragma once

#include <cstdint>

#include "stages/data/mesh.h"

namespace lamina {

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

/// The heights that the 16 triangles of a cluster reach, in steps that their block defines, modulo 256: enough to skip nearly
/// all triangles that a plane does not cut, without reading any vertex.
struct FacetSteps {
  std::uint8_t low[kClusterSize];   // the step of the lowest corner
  std::uint8_t span[kClusterSize];  // steps from there to the one 1 nm below the highest corner, or 255: any plane may cut it
};

/// 16 triangles as numbers of vertices in the table of their block: corner k of triangle i is vertex corner[k][i].
struct alignas(64) IndexedCluster {
  FacetSteps steps;
  std::uint16_t corner[3][kClusterSize];
};
static_assert(sizeof(IndexedCluster) == 128);

/// Writes all corners of an indexed cluster. 4 bytes behind the last vertex of the table must be readable.
void expand_cluster(const IndexedCluster& from, const Point3* vertices, Cluster& out);

// --- how many triangles a block has.

/// Triangles that are ordered and stored together: neighbours of a file's order, 144 KiB, which fits a core's cache.
inline constexpr std::uint32_t kBlockSize = 4096;

}  // namespace lamina
