#include "stages/raster/clusters.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>

namespace lamina::raster {
namespace {

constexpr std::uint32_t kBlock = 4096;  // triangles sorted together: 144 KiB, twice of which fits a core's cache

/// Writes 16 triangles as a cluster; where there are fewer, the last ones' places are points.
void write_cluster(const Triangle* triangles, std::uint32_t count, Triangle* place, Box& bounds) {
  Cluster cluster;
  bounds = {};
  for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
    Triangle t = triangles[std::min(lane, count - 1)];
    if (lane >= count) t.b = t.c = t.a;
    const Point3 corners[3] = {t.a, t.b, t.c};
    for (std::uint32_t k = 0; k < 3; ++k) {
      cluster.x[k][lane] = corners[k].x;
      cluster.y[k][lane] = corners[k].y;
      cluster.z[k][lane] = corners[k].z;
      bounds.add(corners[k]);
    }
  }
  std::memcpy(static_cast<void*>(place), &cluster, sizeof cluster);
}

/// Twice the height of the middle of a facet, nm.
std::int64_t doubled_middle(const Triangle& t) {
  const auto [lo, hi] = std::minmax({t.a.z, t.b.z, t.c.z});
  return std::int64_t{lo} + hi;
}

/// Where a triangle stands in the order of its block: by height in steps, then along y. 15 bits.
///
/// A job's planes and beams visit a cluster as often as its height times its depth says, the latter blurred by what a beam is
/// deep; how wide it is costs nothing. Of mean facets h high in a block H high and D deep, that is least at the step below.
class BlockOrder {
 public:
  explicit BlockOrder(std::span<const Triangle> block) {
    std::int64_t highest = std::numeric_limits<std::int64_t>::min(), heights = 0;
    Nm deepest = std::numeric_limits<Nm>::min();
    for (const Triangle& t : block) {
      const auto [lo, hi] = std::minmax({t.a.z, t.b.z, t.c.z});
      lowest_ = std::min(lowest_, std::int64_t{lo} + hi);
      highest = std::max(highest, std::int64_t{lo} + hi);
      heights += std::int64_t{hi} - lo;
      front_ = std::min(front_, t.a.y);
      deepest = std::max(deepest, t.a.y);
    }
    const double height = static_cast<double>(highest - lowest_),
                 mean = static_cast<double>(heights) / static_cast<double>(block.size());
    const double depth = static_cast<double>(std::int64_t{deepest} - front_);
    const double clusters = static_cast<double>(block.size()) / kClusterSize;
    const double step = std::max(std::sqrt(2 * height * depth * mean / (clusters * kBeam)), mean / 2);
    steps_a_nm_ = 1 / std::max(step, height / (kSteps - 1) + 1);
    rows_a_nm_ = kAlmostRows / std::max(1.0, depth);
  }

  std::uint16_t operator()(const Triangle& t) const {
    const auto step = static_cast<std::uint32_t>(static_cast<double>(doubled_middle(t) - lowest_) * steps_a_nm_);
    const auto row = static_cast<std::uint32_t>(static_cast<double>(std::int64_t{t.a.y} - front_) * rows_a_nm_);
    return static_cast<std::uint16_t>(step << 6 | row);
  }

 private:
  static constexpr double kSteps = 1 << 9;
  static constexpr double kAlmostRows = 63.99;                      // so that the last row is 63
  static constexpr double kBeam = 2e6;                              // nm
  std::int64_t lowest_ = std::numeric_limits<std::int64_t>::max();  // heights are doubled
  Nm front_ = std::numeric_limits<Nm>::max();
  double steps_a_nm_, rows_a_nm_;
};

/// Orders the triangles of one block: two passes of a radix sort.
void sort_block(std::span<const Triangle> block, std::span<Triangle> sorted) {
  const BlockOrder place(block);
  std::array<std::uint16_t, kBlock> key, first_order, order;
  std::array<std::uint16_t, 257> low{}, high{};
  const auto count = static_cast<std::uint32_t>(block.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    key[i] = place(block[i]);
    ++low[(key[i] & 255) + 1u];
    ++high[(key[i] >> 8) + 1u];
  }
  for (std::uint32_t b = 0; b < 256; ++b) {
    low[b + 1] = static_cast<std::uint16_t>(low[b + 1] + low[b]);
    high[b + 1] = static_cast<std::uint16_t>(high[b + 1] + high[b]);
  }
  for (std::uint32_t i = 0; i < count; ++i) first_order[low[key[i] & 255]++] = static_cast<std::uint16_t>(i);
  for (std::uint32_t i = 0; i < count; ++i) order[high[key[first_order[i]] >> 8]++] = first_order[i];
  for (std::uint32_t i = 0; i < count; ++i) sorted[i] = block[order[i]];
}

/// Turns `count` triangles, a whole number of clusters' room, into clusters where they lie.
void cluster_in_place(Triangle* triangles, std::uint32_t count, Box* bounds, bool sorted_already) {
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, (count + kBlock - 1) / kBlock),
                    [&](const tbb::blocked_range<std::uint32_t>& range) {
                      Buffer<Triangle> copy(kBlock);
                      for (std::uint32_t b = range.begin(); b != range.end(); ++b) {
                        const std::uint32_t first = b * kBlock, size = std::min(kBlock, count - first);
                        if (sorted_already) {
                          std::copy_n(triangles + first, size, copy.data());
                        } else {
                          sort_block({triangles + first, size}, {copy.data(), size});
                        }
                        for (std::uint32_t i = 0; i < size; i += kClusterSize) {
                          write_cluster(copy.data() + i, std::min(kClusterSize, size - i), triangles + first + i,
                                        bounds[(first + i) / kClusterSize]);
                        }
                      }
                    });
}

std::uint32_t clusters_for(std::uint32_t triangles) { return (triangles + kClusterSize - 1) / kClusterSize; }

}  // namespace

ClusteredMesh make_clusters(Mesh& mesh) {
  const auto total = static_cast<std::uint32_t>(mesh.triangles.size());
  const std::uint32_t own = std::min(mesh.repaired_from, total), caps = total - own;
  ClusteredMesh out;
  out.first_cap = clusters_for(own);
  out.closed = mesh.closed;
  const std::uint32_t clusters = out.first_cap + clusters_for(caps);
  const std::uint32_t first_cap_at = out.first_cap * kClusterSize;

  out.storage_ = std::move(mesh.triangles);
  mesh.triangles = {};
  out.storage_.reserve(std::size_t{clusters} * kClusterSize);  // nothing moves if the loader left kTriangleSlack
  out.storage_.resize(std::size_t{clusters} * kClusterSize);
  if (first_cap_at != own) {
    std::copy_backward(out.storage_.begin() + own, out.storage_.begin() + total, out.storage_.begin() + first_cap_at + caps);
  }
  out.bounds.resize(clusters);
  cluster_in_place(out.storage_.data(), own, out.bounds.data(), false);
  cluster_in_place(out.storage_.data() + first_cap_at, caps, out.bounds.data() + out.first_cap, true);
  return out;
}

}  // namespace lamina::raster
