#include "stages/raster/clusters.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_reduce.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <bit>
#include <numeric>
#include <span>

namespace lamina::raster {
namespace {

constexpr std::uint32_t kGrain = 1024;  // clusters a task
constexpr std::uint32_t kSplitBits = 10;
constexpr std::uint32_t kFineBits = 20;

Box box_of(const Triangle& triangle) {
  Box box;
  box.add(triangle.a);
  box.add(triangle.b);
  box.add(triangle.c);
  return box;
}

/// Expected visits of a cluster are its height times its depth, the latter blurred by what a beam is deep.
double visits(const Box& box) {
  constexpr double kBeam = 2e6;
  return static_cast<double>(box.height()) * (static_cast<double>(box.depth()) + kBeam);
}

/// Whether neighbours in the list are neighbours in space: compares the clusters that the list gives as it is with
/// what 16 triangles lying side by side would give (some 4 times as tall as one).
bool is_local(std::span<const Triangle> triangles) {
  struct Sums {
    double clusters = 0, triangles = 0;
  };
  const auto count = static_cast<std::uint32_t>(triangles.size() / kClusterSize);
  const Sums sums = tbb::parallel_reduce(
      tbb::blocked_range<std::uint32_t>(0, count, kGrain), Sums{},
      [&](const tbb::blocked_range<std::uint32_t>& range, Sums sum) {
        for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
          Box box;
          double single = 0;
          for (const Triangle& triangle : triangles.subspan(std::size_t{c} * kClusterSize, kClusterSize)) {
            const Box one = box_of(triangle);
            single += visits(one);
            box.add(one);
          }
          sum.clusters += visits(box);
          sum.triangles += single / kClusterSize;
        }
        return sum;
      },
      [](Sums a, const Sums& b) { return Sums{a.clusters + b.clusters, a.triangles + b.triangles}; });
  return sums.clusters <= 6 * sums.triangles;
}

/// Spreads the low 10 bits of v to every third bit.
std::uint32_t spread(std::uint32_t v) {
  v = (v | (v << 16)) & 0x030000FF;
  v = (v | (v << 8)) & 0x0300F00F;
  v = (v | (v << 4)) & 0x030C30C3;
  v = (v | (v << 2)) & 0x09249249;
  return v;
}

/// Place of a point on the Morton curve through a box, 30 bits.
class MortonCurve {
 public:
  explicit MortonCurve(const Box& box) : lo_(box.lo) {
    const std::int64_t side = std::max({box.width(), box.depth(), box.height(), std::int64_t{1}});
    scale_ = 1023.0 / static_cast<double>(side);
  }
  std::uint32_t operator()(const Triangle& t) const {
    const auto step = [this](std::int64_t a, std::int64_t b, std::int64_t c, std::int64_t lo) {
      return static_cast<std::uint32_t>(static_cast<double>((a + b + c) / 3 - lo) * scale_);
    };
    return spread(step(t.a.x, t.b.x, t.c.x, lo_.x)) | spread(step(t.a.y, t.b.y, t.c.y, lo_.y)) << 1 |
           spread(step(t.a.z, t.b.z, t.c.z, lo_.z)) << 2;
  }

 private:
  Point3 lo_;
  double scale_;
};

/// Order of the triangles along the curve: split by the upper 10 bits (count, scan, fill), then each bucket alone.
Buffer<std::uint32_t> morton_order(std::span<const Triangle> triangles, const Box& box) {
  struct Keyed {
    std::uint32_t key, triangle;
    bool operator<(const Keyed& other) const { return key != other.key ? key < other.key : triangle < other.triangle; }
  };
  const MortonCurve curve(box);
  const auto total = static_cast<std::uint32_t>(triangles.size());
  constexpr std::uint32_t kBuckets = 1u << kSplitBits;
  const std::uint32_t chunk = std::max(1u << 14, (total + 63) / 64);
  const std::uint32_t chunks = (total + chunk - 1) / chunk;

  Buffer<std::uint32_t> key(total);
  std::vector<std::uint32_t> place(std::size_t{chunks} * kBuckets, 0);
  tbb::parallel_for(0u, chunks, [&](std::uint32_t c) {
    std::uint32_t* count = place.data() + std::size_t{c} * kBuckets;
    const std::uint32_t end = std::min(total, (c + 1) * chunk);
    for (std::uint32_t t = c * chunk; t < end; ++t) {
      key[t] = curve(triangles[t]);
      ++count[key[t] >> kFineBits];
    }
  });
  std::vector<std::uint32_t> bucket_begin(kBuckets + 1, total);
  std::uint32_t running = 0;
  for (std::uint32_t b = 0; b < kBuckets; ++b) {
    bucket_begin[b] = running;
    for (std::uint32_t c = 0; c < chunks; ++c) {
      running += std::exchange(place[std::size_t{c} * kBuckets + b], running);
    }
  }
  Buffer<Keyed> keyed(total);
  tbb::parallel_for(0u, chunks, [&](std::uint32_t c) {
    std::uint32_t* next = place.data() + std::size_t{c} * kBuckets;
    const std::uint32_t end = std::min(total, (c + 1) * chunk);
    for (std::uint32_t t = c * chunk; t < end; ++t) keyed[next[key[t] >> kFineBits]++] = {key[t], t};
  });
  Buffer<std::uint32_t> order = std::move(key);
  tbb::parallel_for(0u, kBuckets, [&](std::uint32_t b) {
    tbb::parallel_sort(keyed.begin() + bucket_begin[b], keyed.begin() + bucket_begin[b + 1]);
    for (std::uint32_t i = bucket_begin[b]; i < bucket_begin[b + 1]; ++i) order[i] = keyed[i].triangle;
  });
  return order;
}

/// Appends ceil(count / 16) clusters; triangle_at(i) is the i-th triangle.
template <class TriangleAt>
void append_clusters(ClusteredMesh& out, std::uint32_t first, std::uint32_t count, const TriangleAt& triangle_at) {
  const std::uint32_t clusters = (count + kClusterSize - 1) / kClusterSize;
  const auto base = static_cast<std::uint32_t>(out.clusters.size());
  out.clusters.resize(base + clusters);
  out.bounds.resize(base + clusters);
  tbb::parallel_for(tbb::blocked_range<std::uint32_t>(0, clusters, kGrain), [&](const auto& range) {
    for (std::uint32_t c = range.begin(); c != range.end(); ++c) {
      Cluster& cluster = out.clusters[base + c];
      Box box;
      for (std::uint32_t lane = 0; lane < kClusterSize; ++lane) {
        const std::uint32_t i = std::min(c * kClusterSize + lane, count - 1);
        Triangle t = triangle_at(first + i);
        if (c * kClusterSize + lane >= count) t.b = t.c = t.a;  // unused lane: a point
        const Point3 corners[3] = {t.a, t.b, t.c};
        for (std::uint32_t k = 0; k < 3; ++k) {
          cluster.x[k][lane] = corners[k].x;
          cluster.y[k][lane] = corners[k].y;
          cluster.z[k][lane] = corners[k].z;
          box.add(corners[k]);
        }
      }
      out.bounds[base + c] = box;
    }
  });
}

}  // namespace

ClusteredMesh make_clusters(Mesh& mesh) {
  ClusteredMesh out;
  const std::span<const Triangle> all = mesh.triangles;
  const auto total = static_cast<std::uint32_t>(all.size());
  const std::uint32_t own = std::min(mesh.repaired_from, total);
  const auto in_file_order = [&](std::uint32_t i) { return all[i]; };
  if (is_local(all.first(own))) {
    append_clusters(out, 0, own, in_file_order);
  } else {
    const Buffer<std::uint32_t> order = morton_order(all.first(own), mesh.bounds);
    append_clusters(out, 0, own, [&](std::uint32_t i) { return all[order[i]]; });
  }
  out.first_cap = static_cast<std::uint32_t>(out.clusters.size());
  append_clusters(out, own, total - own, in_file_order);
  mesh.triangles = {};
  return out;
}

}  // namespace lamina::raster
