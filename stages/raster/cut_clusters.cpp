#include "stages/raster/cut_clusters.h"

#include <algorithm>
#include <set>
#include <utility>

namespace lamina::raster {
namespace {

constexpr std::size_t kAhead = 8, kLine = 64;  // visits, bytes

/// Visits from the first on to clusters of one block (mesh_blocks.h).
std::size_t visits_of_block(std::span<const PlacedMesh> placed, std::span<const ClusterVisit> visits) {
  constexpr std::uint32_t kClusters = MeshBlocks::kClusters;
  const ClusterVisit first = visits.front();
  const std::uint32_t first_cap = placed[first.instance].mesh->first_cap;
  const bool is_cap = first.cluster >= first_cap;
  const std::uint32_t before = is_cap ? first_cap : 0;
  const std::uint32_t begin = before + (first.cluster - before) / kClusters * kClusters;
  const std::uint32_t size = is_cap ? kClusters : std::min(kClusters, first_cap - begin);
  std::size_t count = 1;
  while (count < visits.size() && visits[count].instance == first.instance && visits[count].cluster - begin < size) ++count;
  return count;
}

}  // namespace

/// A mesh is larger than the caches, so clusters are fetched early, those of a block while those of the block before are
/// looked at.
void cut_clusters(const Kernels& kernels, const PixelSampling& sampling, std::span<const PlacedMesh> placed,
                  std::span<const ClusterVisit> visits, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                  Segments& out) {
  const CutTask task{sampling, plane, first_row, last_row, out};
  FoundFacets found;
  CutFacets facets;
  std::uint32_t instance = 0;  // of those found
  const auto cut_found = [&] {
    if (found.size > 0) kernels.cut_found(task, instance, placed[instance].offset, found);
  };
  const auto fetch = [&](std::size_t i) __attribute__((always_inline)) {
    if (i >= visits.size()) return;
    const std::span<const char> stored = placed[visits[i].instance].mesh->stored(visits[i].cluster);
    for (std::size_t line = 0; line < stored.size(); line += kLine) __builtin_prefetch(stored.data() + line);
  };
  for (std::size_t i = 0; i < visits.size();) {
    const ClusterVisit visit = visits[i];
    const PlacedMesh& source = placed[visit.instance];
    const MeshBlocks::Indexed indexed = source.mesh->indexed(visit.cluster);
    if (indexed.cluster == nullptr) {
      fetch(i + kAhead);
      if (facets.is_full()) kernels.cut(task, facets);
      kernels.gather_listed({&source.mesh->listed(visit.cluster), visit.cluster * kClusterSize, visit.instance, source.offset},
                            plane, facets);
      ++i;
      continue;
    }
    std::span<const ClusterVisit> of_block = visits.subspan(i, visits_of_block(placed, visits.subspan(i)));
    i += of_block.size();
    for (std::size_t k = 0; k < kAhead; ++k) fetch(i + k);
    if (visit.instance != instance || !found.reaches(indexed.vertex)) cut_found();
    instance = visit.instance;
    found.reaches(indexed.vertex);
    const IndexedSource block{indexed.cluster, visit.cluster, indexed.vertex,
                              indexed.step_of(std::int64_t{plane} - source.offset.z)};
    while (!of_block.empty()) {
      if (found.is_full()) cut_found(), found.reaches(indexed.vertex);
      of_block = of_block.subspan(kernels.find(block, of_block, found));
    }
  }
  cut_found();
  kernels.cut(task, facets);
}

void mark_crossed(std::span<const PlacedMesh> placed, std::span<const Nm> planes, std::span<std::uint8_t> crossed) {
  Cluster capacity;
  std::set<std::pair<const ClusteredMesh*, Nm>> visited;
  const auto first_from = [&](std::int64_t z) { return std::ranges::lower_bound(planes, z) - planes.begin(); };
  for (const PlacedMesh& one : placed) {
    if (!visited.emplace(one.mesh, one.offset.z).second) continue;
    const std::int64_t lift = one.offset.z;
    for (std::uint32_t c = 0; c < one.mesh->cluster_count(); ++c) {
      const Box& box = one.mesh->bounds[c];
      if (first_from(box.lo.z + lift) == first_from(box.hi.z + lift)) continue;
      const auto& z = one.mesh->cluster(c, capacity).z;
      for (std::uint32_t i = 0; i < kClusterSize; ++i) {
        const auto [lowest, highest] = std::minmax({z[0][i], z[1][i], z[2][i]});
        std::fill(crossed.begin() + first_from(lowest + lift), crossed.begin() + first_from(highest + lift), std::uint8_t{1});
      }
    }
  }
}

}  // namespace lamina::raster
