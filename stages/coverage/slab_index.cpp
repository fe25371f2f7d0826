#include "stages/coverage/slab_index.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace lamina::cover {
namespace {

constexpr std::uint32_t kFinestBucket = 14;  // 16 micrometres: below most layers, and few buckets for a tall part
constexpr std::uint32_t kCoarsestBucket = 32;
constexpr std::uint32_t kBucketLevels = kCoarsestBucket - kFinestBucket + 1;

std::uint32_t level_of(const Box& box) {
  const auto height = static_cast<std::uint64_t>(box.height());
  return std::clamp<std::uint32_t>(static_cast<std::uint32_t>(std::bit_width(height)), kFinestBucket, kCoarsestBucket) -
         kFinestBucket;
}

}  // namespace

SlabIndex::SlabIndex(std::span<const Box> bounds) {
  std::vector<Level> levels(kBucketLevels);
  std::vector<std::int64_t> lowest(kBucketLevels, INT64_MAX), highest(kBucketLevels, INT64_MIN);
  for (const Box& box : bounds) {
    const std::uint32_t l = level_of(box);
    const std::int64_t bucket = std::int64_t{box.lo.z} >> (l + kFinestBucket);
    lowest[l] = std::min(lowest[l], bucket);
    highest[l] = std::max(highest[l], bucket);
  }
  for (std::uint32_t l = 0; l < kBucketLevels; ++l) {
    if (lowest[l] > highest[l]) continue;
    levels[l].shift = l + kFinestBucket;
    levels[l].first_bucket = lowest[l];
    levels[l].offset.assign(static_cast<std::size_t>(highest[l] - lowest[l]) + 2, 0);
  }
  const auto bucket_of = [&](const Box& box) {
    const Level& level = levels[level_of(box)];
    return static_cast<std::size_t>((std::int64_t{box.lo.z} >> level.shift) - level.first_bucket);
  };
  for (const Box& box : bounds) ++levels[level_of(box)].offset[bucket_of(box) + 1];
  for (Level& level : levels) {
    for (std::size_t b = 1; b < level.offset.size(); ++b) level.offset[b] += level.offset[b - 1];
    level.entry.resize(level.offset.empty() ? 0 : level.offset.back());
  }
  // Each offset moves to the end of its bucket while it is filled, which is where the next one begins.
  for (std::uint32_t cluster = 0; cluster < bounds.size(); ++cluster) {
    const Box& box = bounds[cluster];
    Level& level = levels[level_of(box)];
    level.entry[level.offset[bucket_of(box)]++] = {box.lo.z, box.hi.z, cluster};
  }
  for (Level& level : levels) {
    if (level.entry.empty()) continue;
    std::copy_backward(level.offset.begin(), level.offset.end() - 1, level.offset.end());
    level.offset.front() = 0;
    levels_.push_back(std::move(level));
  }
}

std::uint64_t SlabIndex::bytes() const {
  std::uint64_t total = 0;
  for (const Level& level : levels_) total += bytes_held(level.offset) + bytes_held(level.entry);
  return total;
}

}  // namespace lamina::cover
