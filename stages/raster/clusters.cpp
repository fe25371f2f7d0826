#include "stages/raster/clusters.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "stages/raster/morton.h"

namespace lamina::raster {
namespace {

constexpr std::uint32_t kBlock = 4096;  // triangles sorted together: 144 KiB, twice of which fits a core's cache

/// Expected visits of a box by the planes and beams of a job: its height times its depth, the latter blurred by what
/// a beam is deep.
double visits(const Box& box) {
  constexpr double kBeam = 2e6;
  return static_cast<double>(box.height()) * (static_cast<double>(box.depth()) + kBeam);
}

/// How large clusters are, and how large the triangles in them.
struct Spread {
  double clusters = 0, triangles = 0;

  /// Clusters of real files in their own order come to 10 to 25 times a triangle, those of a shuffled file to thousands.
  /// Up to here, ordering the whole mesh costs more than it saves in a job of some hundred layers (measured).
  bool is_poor() const { return clusters > 40 * triangles; }
  friend Spread operator+(const Spread& a, const Spread& b) { return {a.clusters + b.clusters, a.triangles + b.triangles}; }
};

/// Writes 16 triangles as a cluster; where there are fewer, the last ones' places are points.
void write_cluster(const Triangle* triangles, std::uint32_t count, Triangle* place, Box& bounds, Spread& spread) {
  Cluster cluster;
  bounds = {};
  for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
    Triangle t = triangles[std::min(lane, count - 1)];
    if (lane >= count) t.b = t.c = t.a;
    const Point3 corners[3] = {t.a, t.b, t.c};
    Box box;
    for (std::uint32_t k = 0; k < 3; ++k) {
      cluster.x[k][lane] = corners[k].x;
      cluster.y[k][lane] = corners[k].y;
      cluster.z[k][lane] = corners[k].z;
      box.add(corners[k]);
    }
    bounds.add(box);
    spread.triangles += visits(box) / kClusterSize;
  }
  spread.clusters += visits(bounds);
  std::memcpy(static_cast<void*>(place), &cluster, sizeof cluster);
}

/// Orders the triangles of one block along a curve through its own box: 15 bits, two passes of a radix sort.
void sort_block(std::span<const Triangle> block, std::span<Triangle> sorted) {
  Box box;
  for (const Triangle& t : block) box.add(t.a);
  const MortonCurve<5> curve(box);
  std::array<std::uint16_t, kBlock> key, first_order, order;
  std::array<std::uint16_t, 257> low{}, high{};
  const auto count = static_cast<std::uint32_t>(block.size());
  for (std::uint32_t i = 0; i < count; ++i) {
    key[i] = static_cast<std::uint16_t>(curve(block[i].a));
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
Spread cluster_in_place(Triangle* triangles, std::uint32_t count, Box* bounds, bool sorted_already) {
  return tbb::parallel_reduce(
      tbb::blocked_range<std::uint32_t>(0, (count + kBlock - 1) / kBlock), Spread{},
      [&](const tbb::blocked_range<std::uint32_t>& range, Spread spread) {
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
                          bounds[(first + i) / kClusterSize], spread);
          }
        }
        return spread;
      },
      std::plus<Spread>{});
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

  out.storage = std::move(mesh.triangles);
  mesh.triangles = {};
  out.storage.reserve(std::size_t{clusters} * kClusterSize);  // nothing moves if the loader left kTriangleSlack
  out.storage.resize(std::size_t{clusters} * kClusterSize);
  if (first_cap_at != own) {
    std::copy_backward(out.storage.begin() + own, out.storage.begin() + total, out.storage.begin() + first_cap_at + caps);
  }
  out.bounds.resize(clusters);
  const Spread spread = cluster_in_place(out.storage.data(), own, out.bounds.data(), false);
  cluster_in_place(out.storage.data() + first_cap_at, caps, out.bounds.data() + out.first_cap, true);
  out.clusters = {reinterpret_cast<const Cluster*>(out.storage.data()), clusters};

  if (spread.is_poor() && own > kBlock) {
    const auto triangle_at = [&](std::uint32_t i) { return out.clusters[i / kClusterSize].triangle(i % kClusterSize); };
    const Buffer<std::uint32_t> order = morton_order(own, mesh.bounds, triangle_at);
    Buffer<Triangle> ordered(out.storage.size());
    tbb::parallel_for(0u, own, [&](std::uint32_t i) { ordered[i] = triangle_at(order[i]); });
    std::copy(out.storage.begin() + first_cap_at, out.storage.end(), ordered.begin() + first_cap_at);
    out.storage = std::move(ordered);
    cluster_in_place(out.storage.data(), own, out.bounds.data(), true);
    out.clusters = {reinterpret_cast<const Cluster*>(out.storage.data()), clusters};
  }
  return out;
}

}  // namespace lamina::raster
