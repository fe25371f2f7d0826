#include "stages/raster/crossed_planes.h"

#include <algorithm>
#include <set>
#include <utility>

namespace lamina::raster {

void mark_crossed(std::span<const PlacedMesh> placed, std::span<const Nm> planes, std::span<std::uint8_t> crossed) {
  Cluster room;
  std::set<std::pair<const ClusteredMesh*, Nm>> seen;
  const auto first_from = [&](std::int64_t z) { return std::ranges::lower_bound(planes, z) - planes.begin(); };
  for (const PlacedMesh& one : placed) {
    if (!seen.emplace(one.mesh, one.offset.z).second) continue;
    const std::int64_t lift = one.offset.z;
    for (std::uint32_t c = 0; c < one.mesh->cluster_count(); ++c) {
      const Box& box = one.mesh->bounds[c];
      if (first_from(box.lo.z + lift) == first_from(box.hi.z + lift)) continue;
      const auto& z = one.mesh->cluster(c, room).z;
      for (std::uint32_t i = 0; i < kClusterSize; ++i) {
        const auto [lowest, highest] = std::minmax({z[0][i], z[1][i], z[2][i]});
        std::fill(crossed.begin() + first_from(lowest + lift), crossed.begin() + first_from(highest + lift), std::uint8_t{1});
      }
    }
  }
}

}  // namespace lamina::raster
