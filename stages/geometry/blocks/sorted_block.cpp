#include "stages/geometry/blocks/sorted_block.h"

#include <algorithm>
#include <cstring>

namespace lamina {
namespace {

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
