#include "stages/geometry/blocks/block_maker.h"

#include <tbb/blocked_range.h>
#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>

namespace lamina {
namespace {

/// 16 bits of a vertex, each of which depends on every bit of its coordinates.
inline std::uint16_t hash(const Point3& p) {
  __extension__ using Wide = unsigned __int128;
  constexpr std::uint64_t kXy = 0x2d358dccaa6c78a5, kZ = 0x9e3779b97f4a7c15, kOdd = 0x8bb84b93962eacc9;
  const std::uint64_t xy = static_cast<std::uint32_t>(p.x) | std::uint64_t{static_cast<std::uint32_t>(p.y)} << 32;
  const Wide product = static_cast<Wide>(xy ^ kXy) * ((static_cast<std::uint32_t>(p.z) * kZ) ^ kOdd);
  return static_cast<std::uint16_t>((static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64)) >> 48);
}

/// 0 if two vertices are one.
inline std::uint32_t difference(const Point3& p, const Point3& q) {
  return static_cast<std::uint32_t>((p.x ^ q.x) | (p.y ^ q.y) | (p.z ^ q.z));
}

/// All bits or none.
inline std::uint32_t mask_of(bool yes) { return -static_cast<std::uint32_t>(yes); }

}  // namespace

/// Numbers vertices in the order in which clusters name them. returns  whether there are few enough
///
/// No processor foresees whether a corner is a new vertex, so nothing branches on it: every corner is written where the next
/// new vertex would be, and masks choose.
bool BlockMaker::number_vertices(std::span<const Triangle> triangles, std::span<const std::uint16_t> hashes) {
  const auto count = static_cast<std::uint32_t>(triangles.size()), most = count * 3 / 2;
  // Few vertices take few slots, which are emptied in no time.
  const std::uint32_t slots = std::min(kSlots, std::bit_ceil(4 * count));
  std::fill_n(slot_.begin(), slots, kNone);
  vertex_[kNone] = {};
  std::uint32_t vertices = 0;
  for (std::uint32_t i = 0; i < count && vertices <= most; ++i) {
    const Point3* const corner = &triangles[order_[i]].a;
    const std::uint16_t* const corner_hash = &hashes[3 * std::size_t{order_[i]}];
    std::uint16_t* const out = &cluster_[i / kClusterSize].corner[0][i % kClusterSize];
    for (std::uint32_t k = 0; k < 3; ++k) {
      const Point3 p = corner[k];
      std::uint32_t at = corner_hash[k] & (slots - 1), number = slot_[at], is_new = mask_of(number == kNone);
      while ((difference(vertex_[number], p) & ~is_new) != 0) [[unlikely]] {
          at = (at + 1) & (slots - 1);
          number = slot_[at];
          is_new = mask_of(number == kNone);
        }
      number ^= (number ^ vertices) & is_new;
      vertex_[vertices] = p;
      vertices -= is_new;  // which is -1 or 0
      slot_[at] = static_cast<std::uint16_t>(number);
      out[k * kClusterSize] = static_cast<std::uint16_t>(number);
    }
  }
  vertices_ = vertices;
  return vertices <= most;
}

/// Makes points of the lanes of the last cluster that are left.
void BlockMaker::fill_up(std::uint32_t count) {
  const std::uint16_t point = cluster_[(count - 1) / kClusterSize].corner[0][(count - 1) % kClusterSize];
  for (std::uint32_t i = count; i % kClusterSize != 0; ++i) {
    for (auto& corner : cluster_[i / kClusterSize].corner) corner[i % kClusterSize] = point;
  }
}

void BlockMaker::write_plain(std::span<const Triangle> triangles, MeshBlocks::Block& block) const {
  auto* const clusters = reinterpret_cast<Cluster*>(block.bytes);
  const auto count = static_cast<std::uint32_t>(triangles.size());
  for (std::uint32_t i = 0; i < block.clusters * kClusterSize; ++i) {
    Triangle t = triangles[order_[std::min(i, count - 1)]];
    if (i >= count) t.b = t.c = t.a;
    Cluster& cluster = clusters[i / kClusterSize];
    const std::uint32_t lane = i % kClusterSize;
    const Point3 corners[3] = {t.a, t.b, t.c};
    for (std::uint32_t k = 0; k < 3; ++k) {
      cluster.x[k][lane] = corners[k].x;
      cluster.y[k][lane] = corners[k].y;
      cluster.z[k][lane] = corners[k].z;
    }
  }
}

void BlockMaker::make(std::span<const Triangle> triangles, std::span<const std::uint16_t> hashes, MeshBlocks& mesh,
                      std::uint32_t number) {
  MeshBlocks::Block& block = mesh.blocks_[number];
  const auto count = static_cast<std::uint32_t>(triangles.size());
  const std::span<std::uint16_t> order(order_.data(), count);
  if (mesh.is_added(number)) {
    std::iota(order.begin(), order.end(), std::uint16_t{0});
  } else {
    order_block(triangles, order);
  }
  const bool few = number_vertices(triangles, hashes);
  block.clusters = (count + kClusterSize - 1) / kClusterSize;
  block.vertices = few ? vertices_ : 0;
  Box* const bounds = mesh.bounds_.data() + mesh.first_cluster(number);
  if (few) {
    fill_up(count);
    const std::size_t clusters = block.clusters * sizeof(IndexedCluster), vertices = vertices_ * sizeof(Point3);
    block.bytes = mesh.pages_.take(clusters + vertices + 4);
    std::memcpy(block.bytes, cluster_.data(), clusters);
    std::memcpy(block.bytes + clusters, vertex_.data(), vertices);
    for (std::uint32_t c = 0; c < block.clusters; ++c) bounds[c] = bounds_of(cluster_[c], vertex_.data());
  } else {
    block.bytes = mesh.pages_.take(block.clusters * sizeof(Cluster));
    write_plain(triangles, block);
    for (std::uint32_t c = 0; c < block.clusters; ++c) bounds[c] = bounds_of(block.plain()[c]);
  }
}

void BlockMaker::make(std::span<const Triangle> triangles, MeshBlocks& mesh, std::uint32_t block) {
  std::uint16_t* next = hash_.data();
  for (const Triangle& t : triangles) {
    for (const Point3* const p : {&t.a, &t.b, &t.c}) *next++ = hash(*p);
  }
  make(triangles, {hash_.data(), next}, mesh, block);
}

namespace {

using Makers = tbb::enumerable_thread_specific<std::unique_ptr<BlockMaker>>;

std::shared_ptr<MeshBlocks> take_blocks_of(Mesh& mesh, Makers& makers) {
  if (mesh.blocks) return std::move(mesh.blocks);
  const auto total = static_cast<std::uint32_t>(mesh.triangles.size()), own = std::min(mesh.repaired_from, total);
  Buffer<Triangle> list = std::move(mesh.triangles);
  mesh.triangles = {};
  auto blocks = std::make_shared<MeshBlocks>(own, total - own);
  constexpr std::uint32_t kTogether = 16;  // blocks, 2.25 MiB of the list
  tbb::parallel_for(
      tbb::blocked_range<std::uint32_t>(0, blocks->block_count(), kTogether),
      [&](const tbb::blocked_range<std::uint32_t>& range) {
        BlockMaker& maker = *makers.local();
        Triangle* const begin = list.data() + blocks->first_triangle(range.begin());
        Triangle* end = begin;
        for (std::uint32_t b = range.begin(); b != range.end(); ++b) {
          const std::uint32_t count = blocks->triangles_in(b);
          maker.make({end, count}, *blocks, b);
          end += count;
        }
        if (blocks->block_count() > kTogether) forget_pages(begin, end);
      },
      tbb::simple_partitioner());
  blocks->seal();
  return blocks;
}

}  // namespace

std::vector<std::shared_ptr<MeshBlocks>> take_blocks(std::span<Mesh> meshes) {
  std::vector<std::shared_ptr<MeshBlocks>> blocks(meshes.size());
  Makers makers(new_block_maker);
  tbb::parallel_for(std::size_t{0}, meshes.size(), [&](std::size_t i) { blocks[i] = take_blocks_of(meshes[i], makers); });
  return blocks;
}

std::shared_ptr<MeshBlocks> take_blocks(Mesh& mesh) { return std::move(take_blocks(std::span(&mesh, 1)).front()); }

}  // namespace lamina
