#include "stages/raster/cut_clusters.h"

namespace lamina::raster {

/// A mesh is larger than the caches, so clusters are fetched early, and what they name as soon as it is found: it is gathered
/// when many facets are. Fetched are the first corners of as many facets as most clusters have: no processor foresees the end
/// of a loop over those that there are.
void cut_clusters(const Kernels& kernels, const PixelSampling& sampling, std::span<const PlacedMesh> placed,
                  std::span<const ClusterVisit> visits, Nm plane, std::uint32_t first_row, std::uint32_t last_row,
                  Segments& out) {
  constexpr std::size_t kAhead = 8, kLine = 64;  // clusters, bytes
  constexpr std::uint32_t kCorners = kClusterSize / 2;
  FoundFacets found;
  CutFacets facets;
  std::uint32_t instance = 0;  // of those found
  const auto cut = [&] { kernels.cut(sampling, facets, plane, first_row, last_row, out); };
  const auto gather = [&] {
    if (found.size == 0) return;
    if (facets.size + found.size > CutFacets::kRoom) cut();
    kernels.gather(found, instance, placed[instance].offset, plane, facets);
  };
  for (std::size_t i = 0; i < visits.size(); ++i) {
    if (i + kAhead < visits.size()) {
      const ClusterVisit& later = visits[i + kAhead];
      const std::span<const char> stored = placed[later.instance].mesh->stored(later.cluster);
      for (std::size_t line = 0; line < stored.size(); line += kLine) __builtin_prefetch(stored.data() + line);
    }
    const ClusterVisit visit = visits[i];
    const PlacedMesh& source = placed[visit.instance];
    const std::uint32_t first_facet = visit.cluster * kClusterSize;
    const MeshBlocks::Indexed indexed = source.mesh->indexed(visit.cluster);
    if (indexed.cluster == nullptr) {
      if (facets.is_full()) cut();
      kernels.gather_listed({&source.mesh->listed(visit.cluster), first_facet, visit.instance, source.offset}, plane, facets);
      continue;
    }
    if (found.is_full() || visit.instance != instance) gather();
    instance = visit.instance;
    const std::uint32_t first = found.size;
    kernels.find({indexed.cluster, indexed.vertex, first_facet, indexed.step_of(std::int64_t{plane} - source.offset.z)}, found);
    for (std::uint32_t k = first; k < first + kCorners; ++k) __builtin_prefetch(found.table[k] + found.corner[0][k]);
  }
  gather();
  cut();
}

}  // namespace lamina::raster
