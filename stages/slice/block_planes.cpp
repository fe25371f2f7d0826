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

/// Appends the facets of a cluster that a plane may cross, whose vertices are fetched early.
std::uint32_t* BlockPlanes::near_in(std::uint32_t cluster, std::int64_t z, std::uint32_t* to) const {
  const Box& box = blocks_.bounds()[cluster];
  if (is_above_plane(box.lo.z, z) || !is_above_plane(box.hi.z, z)) return to;
  const MeshBlocks::Indexed indexed = blocks_.indexed(cluster);
  if (indexed.cluster == nullptr) {
    for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) *to++ = cluster * kClusterSize + lane;
    return to;
  }
  const FacetSteps& steps = indexed.cluster->steps;
  const std::uint8_t step = indexed.step_of(z + kPlaneReach);
  std::uint8_t met[kClusterSize];
  for (std::uint32_t i = 0; i < kClusterSize; ++i)
    met[i] = static_cast<std::uint8_t>(step - steps.low[i]) <= steps.span[i] ? 1 : 0;
  std::uint32_t near = 0;
  for (std::uint32_t i = 0; i < kClusterSize; ++i) near |= std::uint32_t{met[i]} << i;
  for (; near != 0; near &= near - 1) {
    const auto lane = static_cast<std::uint32_t>(std::countr_zero(near));
    for (const auto& corner : indexed.cluster->corner) __builtin_prefetch(indexed.vertex + corner[lane]);
    *to++ = cluster * kClusterSize + lane;
  }
  return to;
}

/// Appends those facets that a plane crosses, and their ranks.
void BlockPlanes::keep_crossed(std::span<const std::uint32_t> near, std::uint32_t plane, BlockScratch& scratch) const {
  const std::int64_t z = planes_[plane];
  const bool copies = counts_[plane] <= kManyCuts;
  for (const std::uint32_t facet : near) {
    const Triangle t = facet_of(blocks_, facet);
    const auto [low, high] = std::minmax({t.a.z, t.b.z, t.c.z});
    if (is_above_plane(low, z) || !is_above_plane(high, z)) continue;
    const auto [first, last] = first_at_or_above_.crossed(low, high);
    scratch.facets.push_back(facet);
    scratch.key.push_back(rank_of(first, last, plane));
    if (copies) scratch.copies.push_back(t);
  }
}

/// Puts what was found of one block from `begin` on in the order of the file. first  cluster of the block
void BlockPlanes::sort_listed(std::uint32_t first, std::size_t begin, BlockScratch& scratch) const {
  constexpr std::uint32_t kBits = 12, kRankBits = 7;
  static_assert(1u << kBits == kBlockSize && 2 * kBits + kRankBits <= 32);
  const std::uint32_t base = first * kClusterSize, block = blocks_.listed_number(first, 0) / kBlockSize * kBlockSize;
  scratch.listed.clear();
  for (std::size_t i = begin; i < scratch.facets.size(); ++i) {
    const std::uint32_t facet = scratch.facets[i];
    const std::uint32_t number = blocks_.listed_number(facet / kClusterSize, facet % kClusterSize) - block;
    scratch.listed.push_back(number << (kBits + kRankBits) | (facet - base) << kRankBits | scratch.key[i]);
  }
  std::ranges::sort(scratch.listed);
  for (std::size_t i = 0; i < scratch.listed.size(); ++i) {
    scratch.facets[begin + i] = base + (scratch.listed[i] >> kRankBits & (kBlockSize - 1));
    scratch.key[begin + i] = static_cast<std::uint8_t>(scratch.listed[i] & ((1u << kRankBits) - 1));
    if (!scratch.copies.empty()) scratch.copies[begin + i] = facet_of(blocks_, scratch.facets[begin + i]);
  }
}

void BlockPlanes::find(std::uint32_t plane, BlockScratch& scratch, Buffer<std::uint32_t>& facets,
                       Buffer<Triangle>& copies) const {
  scratch.groups.clear();
  table_.append(plane, scratch.groups);
  std::ranges::sort(scratch.groups);
  scratch.facets.clear();
  scratch.key.clear();
  scratch.copies.clear();
  if (counts_[plane] <= kManyCuts) ensure_capacity(scratch.copies, counts_[plane]);
  ensure_capacity(scratch.facets, counts_[plane]);
  ensure_capacity(scratch.key, counts_[plane]);
  for (std::size_t g = 0, end = 0; g < scratch.groups.size(); g = end) {
    constexpr std::uint32_t kInBlock = MeshBlocks::kClusters / kIndexedTogether;
    const std::uint32_t block = scratch.groups[g] / kInBlock;
    const std::size_t before = scratch.facets.size();
    std::array<std::uint32_t, kBlockSize> near;
    std::uint32_t* behind = near.data();
    for (; end < scratch.groups.size() && scratch.groups[end] / kInBlock == block; ++end) {
      const std::uint32_t from = scratch.groups[end] * kIndexedTogether;
      for (std::uint32_t c = from; c < std::min(from + kIndexedTogether, blocks_.cluster_count()); ++c)
        behind = near_in(c, planes_[plane], behind);
    }
    keep_crossed({near.data(), behind}, plane, scratch);
    const std::uint32_t first = block * MeshBlocks::kClusters;
    if (blocks_.indexed(first).cluster == nullptr) sort_listed(first, before, scratch);
  }
  std::array<std::uint32_t, kRanks> position{};
  for (const std::uint8_t rank : scratch.key) ++position[rank];
  std::uint32_t total = 0;
  for (std::uint32_t& of : position) total += std::exchange(of, total);
  facets.resize(total);
  copies.resize(scratch.copies.size());
  for (std::size_t i = 0; i < total; ++i) {
    const std::uint32_t at = position[scratch.key[i]]++;
    facets[at] = scratch.facets[i];
    if (!copies.empty()) copies[at] = scratch.copies[i];
  }
}

}  // namespace lamina::slice
