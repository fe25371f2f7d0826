#include "stages/slice/block_planes.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <utility>

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

std::uint32_t level_of(std::uint32_t first, std::uint32_t last) { return std::bit_width(last - first - 1); }

/// Of planes [first, last) that a facet crosses, its rank in a PlaneIndex but for its number: by level, then by the bucket of
/// the first plane, which is that of `plane` or the one before.
std::uint8_t rank_of(std::uint32_t first, std::uint32_t last, std::uint32_t plane) {
  const std::uint32_t level = level_of(first, last), own_bucket = first >> level == plane >> level ? 1 : 0;
  return static_cast<std::uint8_t>(2 * level + own_bucket);
}
constexpr std::size_t kRanks = 66;

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kGroupsAhead = 8;

std::uint32_t groups_of(const MeshBlocks& blocks) { return (blocks.cluster_count() + kIndexedTogether - 1) / kIndexedTogether; }

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
               for (std::uint32_t g = 0; g < groups_of(blocks); ++g) {
                 const std::uint32_t from = g * kIndexedTogether,
                                     end = std::min(from + kIndexedTogether, blocks.cluster_count());
                 Nm low = INT32_MAX, high = INT32_MIN;
                 for (const Box& box : blocks.bounds().subspan(from, end - from))
                   low = std::min(low, box.lo.z), high = std::max(high, box.hi.z);
                 const auto [first, last] = first_at_or_above_.crossed(low, high);
                 if (first < last) use({first, last, g});
               }
             }),
      counts_(planes.size(), 0u) {
  assert(blocks.keeps_order() && blocks.first_cap() == blocks.cluster_count());
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

/// Requests the memory of groups that are read soon: the boxes of the last one, and what is stored of the first.
void BlockPlanes::fetch(std::span<const std::uint32_t> groups, std::int64_t z) const {
  const auto* boxes = reinterpret_cast<const char*>(&blocks_.bounds()[groups.back() * kIndexedTogether]);
  __builtin_prefetch(boxes);
  __builtin_prefetch(boxes + kCacheLine);
  const std::uint32_t from = groups.front() * kIndexedTogether,
                      end = std::min(from + kIndexedTogether, blocks_.cluster_count());
  for (std::uint32_t c = from; c < end; ++c) {
    if (!meets(c, z)) continue;
    const std::span<const char> stored = blocks_.stored(c);
    __builtin_prefetch(stored.data());
    __builtin_prefetch(stored.data() + kCacheLine);
  }
}

/// Appends the facets of a group that may cross a plane, and requests their vertices.
void BlockPlanes::find_near(std::uint32_t group, std::int64_t z, Buffer<std::uint32_t>& near) const {
  const std::uint32_t from = group * kIndexedTogether, end = std::min(from + kIndexedTogether, blocks_.cluster_count());
  for (std::uint32_t c = from; c < end; ++c) {
    if (!meets(c, z)) continue;
    const MeshBlocks::Indexed indexed = blocks_.indexed(c);
    std::uint8_t met[kClusterSize];
    if (indexed.cluster != nullptr) {
      const FacetSteps& steps = indexed.cluster->steps;
      const std::uint8_t step = indexed.step_of(z + kPlaneReach);
      for (std::uint32_t i = 0; i < kClusterSize; ++i)
        met[i] = static_cast<std::uint8_t>(step - steps.low[i]) <= steps.span[i] ? 1 : 0;
    } else {
      const Heights heights = heights_in(blocks_.listed(c));
      for (std::uint32_t i = 0; i < kClusterSize; ++i)
        met[i] = heights.low[i] <= z + kPlaneReach && heights.high[i] > z + kPlaneReach ? 1 : 0;
    }
    std::uint32_t lanes = 0;
    for (std::uint32_t i = 0; i < kClusterSize; ++i) lanes |= std::uint32_t{met[i]} << i;
    for (; lanes != 0; lanes &= lanes - 1) {
      const auto lane = static_cast<std::uint32_t>(std::countr_zero(lanes));
      near.push_back(c * kClusterSize + lane);
      for (std::uint32_t k = 0; k < 3 && indexed.cluster != nullptr; ++k)
        __builtin_prefetch(&indexed.vertex[indexed.cluster->corner[k][lane]]);
    }
  }
}

/// Puts what is near of a block in the order of the file. first  cluster of the block
void BlockPlanes::sort_listed(std::uint32_t first, BlockScratch& scratch) const {
  const std::uint32_t base = first * kClusterSize, block = blocks_.listed_number(first, 0) / kBlockSize * kBlockSize;
  scratch.listed.clear();
  for (const std::uint32_t facet : scratch.near) {
    const std::uint32_t number = blocks_.listed_number(facet / kClusterSize, facet % kClusterSize) - block;
    scratch.listed.push_back(number * kBlockSize + facet - base);
  }
  std::ranges::sort(scratch.listed);
  for (std::size_t i = 0; i < scratch.listed.size(); ++i) scratch.near[i] = base + scratch.listed[i] % kBlockSize;
}

void BlockPlanes::find(std::uint32_t plane, BlockScratch& scratch, Buffer<std::uint32_t>& facets, Buffer<std::uint32_t>& order,
                       const std::function<void(std::span<const Triangle>)>& take) const {
  const std::int64_t z = planes_[plane];
  auto& groups = scratch.groups;
  groups.clear();
  table_.append(plane, groups);
  std::ranges::sort(groups);
  facets.clear();
  scratch.rank.clear();
  ensure_capacity(facets, counts_[plane]);
  ensure_capacity(scratch.rank, counts_[plane]);
  for (std::size_t g = 0; g < groups.size();) {
    constexpr std::uint32_t kInBlock = MeshBlocks::kClusters / kIndexedTogether;
    const std::uint32_t block = groups[g] / kInBlock, first_cluster = block * MeshBlocks::kClusters;
    scratch.near.clear();
    for (; g < groups.size() && groups[g] / kInBlock == block; ++g) {
      if (g + 2 * kGroupsAhead < groups.size()) fetch(std::span(groups).subspan(g + kGroupsAhead, kGroupsAhead + 1), z);
      find_near(groups[g], z, scratch.near);
    }
    if (blocks_.indexed(first_cluster).cluster == nullptr) sort_listed(first_cluster, scratch);
    scratch.crossed.clear();
    for (const std::uint32_t facet : scratch.near) {
      const Triangle t = facet_of(blocks_, facet);
      const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
      if (is_above_plane(low, z) || !is_above_plane(high, z)) continue;
      const auto [first, last] = first_at_or_above_.crossed(low, high);
      scratch.rank.push_back(rank_of(first, last, plane));
      facets.push_back(facet);
      scratch.crossed.push_back(t);
    }
    take(scratch.crossed);
  }
  std::array<std::uint32_t, kRanks> position{};
  for (const std::uint8_t rank : scratch.rank) ++position[rank];
  std::uint32_t total = 0;
  for (std::uint32_t& of : position) total += std::exchange(of, total);
  ensure_capacity(order, total);
  order.resize(total);
  for (std::uint32_t i = 0; i < total; ++i) order[position[scratch.rank[i]]++] = i;
}

}  // namespace lamina::slice
