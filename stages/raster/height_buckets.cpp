#include "stages/raster/height_buckets.h"

#include <algorithm>
#include <bit>

namespace lamina::raster {
namespace {

constexpr std::uint32_t kFinest = 14;  // 16 micrometres: far below any layer, and few buckets for a tall part
constexpr std::uint32_t kCoarsest = 32;

std::uint32_t level_of(const Box& box) {
  const auto height = static_cast<std::uint64_t>(box.height());
  return std::clamp<std::uint32_t>(static_cast<std::uint32_t>(std::bit_width(height)), kFinest, kCoarsest) - kFinest;
}

}  // namespace

HeightBuckets::HeightBuckets(const ClusteredMesh& mesh) {
  constexpr std::uint32_t kLevels = kCoarsest - kFinest + 1;
  std::vector<Level> levels(kLevels);
  std::vector<std::int64_t> lowest(kLevels, INT64_MAX), highest(kLevels, INT64_MIN);
  for (const Box& box : mesh.bounds) {
    const std::uint32_t l = level_of(box);
    const std::int64_t bucket = std::int64_t{box.lo.z} >> (l + kFinest);
    lowest[l] = std::min(lowest[l], bucket);
    highest[l] = std::max(highest[l], bucket);
  }
  for (std::uint32_t l = 0; l < kLevels; ++l) {
    if (lowest[l] > highest[l]) continue;
    levels[l].shift = l + kFinest;
    levels[l].first_bucket = lowest[l];
    levels[l].offset.assign(static_cast<std::size_t>(highest[l] - lowest[l]) + 2, 0);
  }
  const auto bucket_of = [&](const Box& box) {
    const Level& level = levels[level_of(box)];
    return static_cast<std::size_t>((std::int64_t{box.lo.z} >> level.shift) - level.first_bucket);
  };
  for (const Box& box : mesh.bounds) ++levels[level_of(box)].offset[bucket_of(box)];
  for (Level& level : levels) {
    std::uint32_t total = 0;
    for (std::uint32_t& offset : level.offset) total += std::exchange(offset, total);
    level.entry.resize(total);
  }
  for (std::uint32_t cluster = 0; cluster < mesh.bounds.size(); ++cluster) {
    const Box& box = mesh.bounds[cluster];
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

void HeightBuckets::find_clusters(std::int64_t plane, std::uint32_t instance, ClusterVisits& out) const {
  for (const Level& level : levels_) {
    const std::int64_t buckets = static_cast<std::int64_t>(level.offset.size()) - 1;
    const std::int64_t own = (plane >> level.shift) - level.first_bucket;
    const std::int64_t begin = std::clamp<std::int64_t>(own - 1, 0, buckets);
    const std::int64_t end = std::clamp<std::int64_t>(own + 1, 0, buckets);
    for (std::uint32_t i = level.offset[begin]; i < level.offset[end]; ++i) {
      const Entry& entry = level.entry[i];
      if (entry.lo <= plane && entry.hi > plane) out.push_back({entry.cluster, instance});
    }
  }
}

std::uint64_t HeightBuckets::bytes() const {
  std::uint64_t total = 0;
  for (const Level& level : levels_) total += bytes_held(level.offset) + bytes_held(level.entry);
  return total;
}

}  // namespace lamina::raster
