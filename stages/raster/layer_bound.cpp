#include "stages/raster/layer_bound.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <map>
#include <vector>

namespace lamina::raster {

LayerBound::LayerBound(std::span<const PlacedMesh> placed, const PixelGrid& grid) {
  std::int64_t top = 1;
  // Copies at one height differ only in x and y: they are looked at once and counted as often as they stand.
  std::map<std::pair<const ClusteredMesh*, Nm>, std::uint64_t> copies;
  for (const PlacedMesh& one : placed) {
    ++copies[{one.mesh, one.offset.z}];
    for (const Box& box : one.mesh->bounds) top = std::max(top, std::int64_t{box.hi.z} + one.offset.z);
  }
  slab_height_ = top / kSlabs + 1;

  using Differences = std::vector<std::array<std::int64_t, 2>>;  // segments, crossings
  const double rows_per_nm = grid.y.pixels_per_nm();
  const double slabs_per_nm = 1.0 / static_cast<double>(slab_height_);
  for (const auto& [key, count] : copies) {
    const ClusteredMesh& mesh = *key.first;
    const Nm lift = key.second;
    const Differences sum = tbb::parallel_reduce(
        tbb::blocked_range<std::uint32_t>(0, mesh.cluster_count(), 4096), Differences(kSlabs + 1, {0, 0}),
        [&](const tbb::blocked_range<std::uint32_t>& range, Differences difference) {
          Cluster room;
          for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
            const Cluster& cluster = mesh.cluster(c, room);
            for (std::uint32_t i = 0; i < kClusterSize; ++i) {
              const auto [lo_z, hi_z] = std::minmax({cluster.z[0][i], cluster.z[1][i], cluster.z[2][i]});
              if (lo_z == hi_z) continue;
              const auto [lo_y, hi_y] = std::minmax({cluster.y[0][i], cluster.y[1][i], cluster.y[2][i]});
              const auto rows = static_cast<std::int64_t>(static_cast<double>(std::int64_t{hi_y} - lo_y) * rows_per_nm) + 2;
              const auto slab_of = [&](Nm z) {
                return std::clamp(static_cast<std::int32_t>((static_cast<double>(z) + lift) * slabs_per_nm), 0,
                                  static_cast<std::int32_t>(kSlabs) - 1);
              };
              auto& begin = difference[static_cast<std::size_t>(slab_of(lo_z))];
              auto& end = difference[static_cast<std::size_t>(slab_of(hi_z)) + 1];
              begin[0] += 1, begin[1] += rows;
              end[0] -= 1, end[1] -= rows;
            }
          }
          return difference;
        },
        [](Differences a, const Differences& b) {
          for (std::size_t i = 0; i < a.size(); ++i) a[i] = {a[i][0] + b[i][0], a[i][1] + b[i][1]};
          return a;
        });
    std::int64_t segments = 0, crossings = 0;
    for (std::uint32_t slab = 0; slab < kSlabs; ++slab) {
      segments += sum[slab][0];
      crossings += sum[slab][1];
      slab_[slab].segments += static_cast<std::uint64_t>(segments) * count;
      slab_[slab].crossings += static_cast<std::uint64_t>(crossings) * count;
    }
  }
}

LayerBound::Count LayerBound::at(Nm plane) const {
  // Doubles may put a facet's end one slab off; the neighbours cover that.
  const std::int64_t slab = std::clamp<std::int64_t>(plane / slab_height_, 0, kSlabs - 1);
  Count most;
  for (std::int64_t s = std::max<std::int64_t>(0, slab - 1); s <= std::min<std::int64_t>(kSlabs - 1, slab + 1); ++s) {
    most.segments = std::max(most.segments, slab_[static_cast<std::size_t>(s)].segments);
    most.crossings = std::max(most.crossings, slab_[static_cast<std::size_t>(s)].crossings);
  }
  return most;
}

}  // namespace lamina::raster
