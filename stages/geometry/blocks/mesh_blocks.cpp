#include "stages/geometry/blocks/mesh_blocks.h"

#include <algorithm>
#include <cstring>

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

namespace lamina {
namespace {

std::uint32_t clusters_for(std::uint32_t triangles) { return (triangles + kClusterSize - 1) / kClusterSize; }
std::uint32_t blocks_for(std::uint32_t triangles) { return (triangles + kBlockSize - 1) / kBlockSize; }
std::uint64_t bytes_of_bounds(std::uint32_t clusters) { return clusters * std::uint64_t{sizeof(Box)} + 63; }

/// No block takes more than its clusters do as they are read.
static_assert(sizeof(IndexedCluster) + kClusterSize * 3 / 2 * sizeof(Point3) + 4 + 63 <= sizeof(Cluster));
std::uint64_t max_bytes(std::uint32_t triangles) { return clusters_for(triangles) * std::uint64_t{sizeof(Cluster)}; }

#if defined(__SSE2__)

/// A vertex, and 4 bytes of the next one.
inline __m128i vertex_at(const Point3* vertices, std::uint16_t number) {
  return _mm_loadu_si128(reinterpret_cast<const __m128i*>(vertices + number));
}

/// Four vertices, turned from rows into columns.
inline void expand_four(const std::uint16_t* corner, const Point3* vertices, Nm* x, Nm* y, Nm* z) {
  const __m128i a = vertex_at(vertices, corner[0]), b = vertex_at(vertices, corner[1]);
  const __m128i c = vertex_at(vertices, corner[2]), d = vertex_at(vertices, corner[3]);
  const __m128i xy_ab = _mm_unpacklo_epi32(a, b), xy_cd = _mm_unpacklo_epi32(c, d);
  const __m128i z_ab = _mm_unpackhi_epi32(a, b), z_cd = _mm_unpackhi_epi32(c, d);
  _mm_store_si128(reinterpret_cast<__m128i*>(x), _mm_unpacklo_epi64(xy_ab, xy_cd));
  _mm_store_si128(reinterpret_cast<__m128i*>(y), _mm_unpackhi_epi64(xy_ab, xy_cd));
  _mm_store_si128(reinterpret_cast<__m128i*>(z), _mm_unpacklo_epi64(z_ab, z_cd));
}

#else

inline void expand_four(const std::uint16_t* corner, const Point3* vertices, Nm* x, Nm* y, Nm* z) {
  for (std::uint32_t i = 0; i < 4; ++i) {
    const Point3& vertex = vertices[corner[i]];
    x[i] = vertex.x;
    y[i] = vertex.y;
    z[i] = vertex.z;
  }
}

#endif

/// Four numbers that are moved at once, on any processor that compilers know.
using Four = std::int32_t __attribute__((vector_size(16)));

inline Four four_at(const Nm* from) {
  Four four;
  std::memcpy(&four, from, sizeof four);
  return four;
}

/// Four numbers of each of four triangles, turned from rows into columns: number n of all to `to[n]`.
inline void turn(Four a, Four b, Four c, Four d, Nm* const (&to)[4]) {
  const Four ab_low = __builtin_shufflevector(a, b, 0, 4, 1, 5), cd_low = __builtin_shufflevector(c, d, 0, 4, 1, 5);
  const Four ab_high = __builtin_shufflevector(a, b, 2, 6, 3, 7), cd_high = __builtin_shufflevector(c, d, 2, 6, 3, 7);
  const Four column[4] = {
      __builtin_shufflevector(ab_low, cd_low, 0, 1, 4, 5), __builtin_shufflevector(ab_low, cd_low, 2, 3, 6, 7),
      __builtin_shufflevector(ab_high, cd_high, 0, 1, 4, 5), __builtin_shufflevector(ab_high, cd_high, 2, 3, 6, 7)};
  for (std::uint32_t n = 0; n < 4; ++n) std::memcpy(to[n], &column[n], sizeof(Four));
}

/// Four triangles as lanes of a cluster.
inline void put_four(const Triangle* list, const std::uint16_t* order, Cluster& cluster, std::uint32_t lane) {
  const Nm *const a = &list[order[0]].a.x, *const b = &list[order[1]].a.x, *const c = &list[order[2]].a.x,
                  *const d = &list[order[3]].a.x;
  turn(four_at(a), four_at(b), four_at(c), four_at(d),
       {&cluster.x[0][lane], &cluster.y[0][lane], &cluster.z[0][lane], &cluster.x[1][lane]});
  turn(four_at(a + 4), four_at(b + 4), four_at(c + 4), four_at(d + 4),
       {&cluster.y[1][lane], &cluster.z[1][lane], &cluster.x[2][lane], &cluster.y[2][lane]});
  const Four last = {a[8], b[8], c[8], d[8]};
  std::memcpy(&cluster.z[2][lane], &last, sizeof last);
}

/// 16 bits of a vertex, each of which depends on every bit of its coordinates.
inline std::uint16_t hash_of(Nm x, Nm y, Nm z) {
  __extension__ using Wide = unsigned __int128;
  constexpr std::uint64_t kXy = 0x2d358dccaa6c78a5, kZ = 0x9e3779b97f4a7c15, kOdd = 0x8bb84b93962eacc9;
  const std::uint64_t xy = static_cast<std::uint32_t>(x) | std::uint64_t{static_cast<std::uint32_t>(y)} << 32;
  const Wide product = static_cast<Wide>(xy ^ kXy) * ((static_cast<std::uint32_t>(z) * kZ) ^ kOdd);
  return static_cast<std::uint16_t>((static_cast<std::uint64_t>(product) ^ static_cast<std::uint64_t>(product >> 64)) >> 48);
}

}  // namespace

MeshBlocks::MeshBlocks(std::uint32_t own, std::uint32_t added, bool keeps_order)
    : own_(own),
      added_(added),
      first_cap_(clusters_for(own)),
      first_cap_block_(blocks_for(own)),
      keeps_order_(keeps_order),
      order_(keeps_order ? std::size_t{own} + added : 0),
      pages_(max_bytes(own) + max_bytes(added) + bytes_of_bounds(clusters_for(own) + clusters_for(added))) {
  blocks_.resize(std::size_t{first_cap_block_} + blocks_for(added));
  const std::uint32_t clusters = first_cap_ + clusters_for(added);
  bounds_ = {reinterpret_cast<Box*>(pages_.take(clusters * sizeof(Box))), clusters};
  bounds_taken_ = pages_.bytes();
}

std::uint32_t MeshBlocks::triangles_in(std::uint32_t block) const {
  const std::uint32_t end = block < first_cap_block_ ? own_ : own_ + added_;
  return std::min(kBlockSize, end - first_triangle(block));
}

void MeshBlocks::list_block(std::uint32_t block, std::span<Triangle> list) const {
  const std::uint32_t count = triangles_in(block), cluster = first_cluster(block), first = first_triangle(block);
  if (blocks_[block].vertices == 0) {
    for (std::uint32_t i = 0; i < count; ++i) list[order_[first + i]] = triangle(cluster + i / kClusterSize, i % kClusterSize);
    return;
  }
  const Point3* const vertex = blocks_[block].vertex();
  const IndexedCluster* const indexed = blocks_[block].indexed();
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto& corner = indexed[i / kClusterSize].corner;
    const std::uint32_t lane = i % kClusterSize;
    list[i] = {vertex[corner[0][lane]], vertex[corner[1][lane]], vertex[corner[2][lane]]};
  }
}

std::uint64_t MeshBlocks::order_bytes() const {
  std::uint64_t bytes = 0;
  for (std::uint32_t b = 0; keeps_order_ && b < blocks_.size(); ++b)
    bytes += blocks_[b].vertices > 0 ? 0 : triangles_in(b) * sizeof(std::uint16_t);
  return bytes;
}

void MeshBlocks::shift(const Point3& by) {
  const auto move = [&](Point3& p) { p = {p.x + by.x, p.y + by.y, p.z + by.z}; };
  for (Block& block : blocks_) {
    block.step_0 += by.z;
    auto* const vertex = const_cast<Point3*>(block.vertex());
    for (std::uint32_t v = 0; v < block.vertices; ++v) move(vertex[v]);
    for (std::uint32_t c = 0; block.vertices == 0 && c < block.clusters; ++c) {
      auto& cluster = reinterpret_cast<Cluster*>(block.bytes)[c];
      for (std::uint32_t k = 0; k < 3; ++k) {
        for (Nm& x : cluster.x[k]) x += by.x;
        for (Nm& y : cluster.y[k]) y += by.y;
        for (Nm& z : cluster.z[k]) z += by.z;
      }
    }
  }
  for (Box& box : bounds_) {
    move(box.lo);
    move(box.hi);
  }
}

Buffer<Triangle> list_of(const MeshBlocks& blocks) {
  Buffer<Triangle> list;
  list.reserve(blocks.triangle_count() + kTriangleSlack);
  if (blocks.keeps_order()) {
    list.resize(blocks.triangle_count());
    for (std::uint32_t b = 0; b < blocks.block_count(); ++b)
      blocks.list_block(b, std::span(list).subspan(blocks.first_triangle(b)));
    return list;
  }
  for (std::uint32_t b = 0; b < blocks.block_count(); ++b) {
    for (std::uint32_t i = 0; i < blocks.triangles_in(b); ++i)
      list.push_back(blocks.triangle(b * MeshBlocks::kClusters + i / kClusterSize, i % kClusterSize));
  }
  return list;
}

void expand_cluster(const IndexedCluster& from, const Point3* vertices, Cluster& out) {
  for (std::uint32_t k = 0; k < 3; ++k) {
    for (std::uint32_t i = 0; i < kClusterSize; i += 4) {
      expand_four(from.corner[k] + i, vertices, out.x[k] + i, out.y[k] + i, out.z[k] + i);
    }
  }
}

void SortedBlock::take(std::span<const Triangle> list, std::span<const std::uint16_t> order) {
  triangles = static_cast<std::uint32_t>(list.size());
  const std::uint32_t whole = triangles / 4 * 4;
  for (std::uint32_t i = 0; i < whole; i += 4) {
    put_four(list.data(), order.data() + i, cluster[i / kClusterSize], i % kClusterSize);
  }
  for (std::uint32_t i = whole; i < clusters() * kClusterSize; ++i) {
    Triangle t = list[order[std::min(i, triangles - 1)]];
    if (i >= triangles) t.b = t.c = t.a;
    Cluster& to = cluster[i / kClusterSize];
    const std::uint32_t lane = i % kClusterSize;
    const Point3 corners[3] = {t.a, t.b, t.c};
    for (std::uint32_t k = 0; k < 3; ++k) {
      to.x[k][lane] = corners[k].x;
      to.y[k][lane] = corners[k].y;
      to.z[k][lane] = corners[k].z;
    }
  }
}

void SortedBlock::hash_corners() {
  std::uint16_t* next = hash.data();
  for (std::uint32_t c = 0; c < clusters(); ++c) {
    const auto& [z, y, x] = cluster[c];
    for (std::uint32_t k = 0; k < 3; ++k) {
      for (std::uint32_t i = 0; i < kClusterSize; ++i) *next++ = hash_of(x[k][i], y[k][i], z[k][i]);
    }
  }
}

}  // namespace lamina
