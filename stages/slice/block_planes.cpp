#include "stages/slice/block_planes.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>

namespace lamina::slice {
namespace {

struct Heights {
  std::array<Nm, kClusterSize> low, high;
};

Heights heights_in(const Cluster& cluster) {
  Heights heights;
  for (std::uint32_t i = 0; i < kClusterSize; ++i) {
    heights.low[i] = std::min(std::min(cluster.z[0][i], cluster.z[1][i]), cluster.z[2][i]);
    heights.high[i] = std::max(std::max(cluster.z[0][i], cluster.z[1][i]), cluster.z[2][i]);
  }
  return heights;
}

/// Of planes [first, last) that facet `id` crosses, its rank in a PlaneIndex: by level, bucket and number.
std::uint64_t rank_of(std::uint32_t first, std::uint32_t last, std::uint32_t id) {
  constexpr std::uint32_t kLevel = 58;  // buckets: 26 bits, more planes than fit into memory with their contours
  const auto level = static_cast<std::uint64_t>(std::bit_width(last - first - 1));
  return level << kLevel | std::uint64_t{first >> level} << 32 | id;
}

}  // namespace

PlaneFinder::PlaneFinder(std::span<const std::int64_t> planes) : planes_(planes) {
  if (planes.empty()) return;
  const auto range = static_cast<std::uint64_t>(planes.back() - planes.front());
  while ((range >> shift_) > 4 * planes.size()) ++shift_;
  position_.resize(static_cast<std::size_t>(range >> shift_) + 1);
  std::uint32_t plane = 0;
  for (std::size_t cell = 0; cell < position_.size(); ++cell) {
    while (planes[plane] < planes.front() + static_cast<std::int64_t>(cell << shift_)) ++plane;
    position_[cell] = plane;
  }
}

BlockPlanes::BlockPlanes(const MeshBlocks& blocks, std::span<const std::int64_t> planes)
    : blocks_(blocks),
      planes_(planes.begin(), planes.end()),
      first_at_or_above_(planes_),
      table_(0, static_cast<std::int64_t>(planes.size()) - 1, 0,
             [&](auto use) {
               for (std::uint32_t c = 0; c < blocks.cluster_count(); ++c) {
                 const auto [first, last] = first_at_or_above_.crossed(blocks.bounds()[c].lo.z, blocks.bounds()[c].hi.z);
                 if (first < last) use({first, last, c});
               }
             }),
      counts_(planes.size(), 0u) {
  using Changes = Buffer<std::uint32_t>;  // of the count from plane to plane, modulo 2^32
  tbb::enumerable_thread_specific<Changes> changes([&] { return Changes(planes_.size() + 1, 0u); });
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, blocks.cluster_count(), 256), [&](const auto& range) {
    Changes& own = changes.local();
    Cluster unpacked;
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
      const Heights heights = heights_in(blocks.cluster(c, unpacked));
      for (std::uint32_t i = 0; i < kClusterSize; ++i) {
        const auto [first, last] = first_at_or_above_.crossed(heights.low[i], heights.high[i]);
        ++own[first], --own[last];
      }
    }
  });
  for (const Changes& some : changes) {
    std::uint32_t now = 0;
    for (std::size_t p = 0; p < counts_.size(); ++p) counts_[p] += now += some[p];
  }
}

void BlockPlanes::find(std::uint32_t plane, BlockScratch& scratch) const {
  scratch.clusters.clear();
  table_.append(plane, scratch.clusters);
  scratch.order.clear();
  scratch.found.clear();
  scratch.order.reserve(counts_[plane]);
  scratch.found.reserve(counts_[plane]);
  const std::int64_t z = planes_[plane];
  Cluster unpacked;
  for (const std::uint32_t c : scratch.clusters) {
    const Cluster& cluster = blocks_.cluster(c, unpacked);
    const Heights heights = heights_in(cluster);
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      if (is_above_plane(heights.low[i], z) || !is_above_plane(heights.high[i], z)) continue;
      const auto [first, last] = first_at_or_above_.crossed(heights.low[i], heights.high[i]);
      scratch.order.push_back(
          {rank_of(first, last, blocks_.listed_number(c, i)), static_cast<std::uint32_t>(scratch.found.size())});
      scratch.found.push_back(cluster.triangle(i));
    }
  }
  std::ranges::sort(scratch.order);
  scratch.facets.resize(scratch.found.size());
  std::ranges::transform(scratch.order, scratch.facets.begin(), [&](const auto& entry) { return scratch.found[entry.second]; });
}

}  // namespace lamina::slice
