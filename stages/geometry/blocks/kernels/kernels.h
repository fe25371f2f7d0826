// stages/geometry/blocks/kernels/kernels.h: the inner loops that make a block, a body for each instruction set.
//
// All bodies of a loop give the same numbers: they are whole ones, and of those that are not every rounding is done lane by
// lane as IEEE 754 has it.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "stages/data/choices.h"
#include "stages/geometry/blocks/mesh_blocks.h"
#include "stages/geometry/targets.h"

namespace lamina {

/// Which corners of a block are the same vertex. 128 KiB.
struct CornerMatches {
  static constexpr std::uint32_t kSlots = 1 << 14;  // more than twice the vertices of a block
  static constexpr std::uint32_t kMore = 16;        // room for the widest load and store
  using OfCorners = std::array<std::uint16_t, 3 * kBlockSize + kMore>;

  alignas(64) std::array<std::uint16_t, kSlots + kMore> slot;  // by hash, the first corner that has it
  OfCorners first;                                             // of each corner, the first one that is the same vertex
  OfCorners rest;                                              // corners whose slot another vertex has, in order
  OfCorners number;                                            // of each corner's vertex
  OfCorners vertex;                                            // the first corner that is this vertex
  std::uint32_t found = 0;                                     // corners that are their own first ones
  std::uint32_t unmatched = 0;                                 // corners in rest
};

/// The corner's z; y and x lie kCorners and twice as much behind it.
inline const Nm* corner_at(const SortedBlock& block, std::uint32_t corner) {
  const std::uint32_t cluster = corner / SortedBlock::kCorners;
  return reinterpret_cast<const Nm*>(&block.cluster[cluster]) + (corner - cluster * SortedBlock::kCorners);
}

/// 0 if two corners are one vertex.
inline std::uint32_t difference(const Nm* p, const Nm* q) {
  constexpr std::uint32_t kY = SortedBlock::kCorners, kX = 2 * SortedBlock::kCorners;
  return static_cast<std::uint32_t>((p[0] ^ q[0]) | (p[kY] ^ q[kY]) | (p[kX] ^ q[kX]));
}

struct BlockKernels {
  Isa isa;

  /// Sets first, found, rest and unmatched from slots; corners that are not matched stay without a first one.
  void (*match)(const SortedBlock& block, CornerMatches& matches);
  /// Numbers vertices in the order of their first corners. returns  how many there are
  std::uint32_t (*number)(std::uint32_t corners, CornerMatches& matches);
  /// Writes `count` vertices by their first corners.
  void (*write)(const SortedBlock& block, const CornerMatches& matches, std::uint32_t count, Point3* to);
  /// The boxes of clusters. returns  the heights of all facets together, from the lowest corner of each to its highest, nm
  std::uint64_t (*bounds)(std::span<const Cluster> clusters, Box* out);
  /// Clusters by the numbers of their corners, with steps of 2^shift nm, counted from 0.
  void (*index)(std::span<const Cluster> clusters, const std::uint16_t* corners, std::uint32_t shift, IndexedCluster* out);
  /// Orders at most kBlockSize triangles by height, and among equals by place: order[i] is the i-th of them.
  ///
  /// Clusters of neighbours in this order are low: a plane meets few of them, and many facets in each. Most exporters write
  /// neighbours near each other; in a file in disorder clusters are wide, but as low as in others. The order has no influence
  /// on any image. cost: O(T), two passes of a radix sort
  void (*order)(std::span<const Triangle> block, std::uint16_t* order);
};

/// The bodies for an instruction set that this processor has (geometry/isa.h), not kAuto.
const BlockKernels& block_kernels_for(Isa isa);

namespace plain {
void match(const SortedBlock& block, CornerMatches& matches);
std::uint32_t number(std::uint32_t corners, CornerMatches& matches);
void write(const SortedBlock& block, const CornerMatches& matches, std::uint32_t count, Point3* to);
std::uint64_t bounds(std::span<const Cluster> clusters, Box* out);
void index(std::span<const Cluster> clusters, const std::uint16_t* corners, std::uint32_t shift, IndexedCluster* out);
void order(std::span<const Triangle> block, std::uint16_t* order);
}  // namespace plain

#if defined(LAMINA_WIDE_KERNELS)
namespace avx2 {
LAMINA_AVX2 void match(const SortedBlock& block, CornerMatches& matches);
LAMINA_AVX2 std::uint64_t bounds(std::span<const Cluster> clusters, Box* out);
LAMINA_AVX2 void index(std::span<const Cluster> clusters, const std::uint16_t* corners, std::uint32_t shift,
                       IndexedCluster* out);
LAMINA_AVX2 void order(std::span<const Triangle> block, std::uint16_t* order);
}  // namespace avx2

namespace avx512 {
LAMINA_AVX512 void match(const SortedBlock& block, CornerMatches& matches);
LAMINA_AVX512 std::uint32_t number(std::uint32_t corners, CornerMatches& matches);
LAMINA_AVX512 void write(const SortedBlock& block, const CornerMatches& matches, std::uint32_t count, Point3* to);
LAMINA_AVX512 std::uint64_t bounds(std::span<const Cluster> clusters, Box* out);
LAMINA_AVX512 void index(std::span<const Cluster> clusters, const std::uint16_t* corners, std::uint32_t shift,
                         IndexedCluster* out);
LAMINA_AVX512 void order(std::span<const Triangle> block, std::uint16_t* order);
}  // namespace avx512
#endif

}  // namespace lamina
