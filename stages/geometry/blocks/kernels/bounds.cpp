// The boxes of clusters and the steps of their facets, 16 lanes at a time. Bodies in whole numbers, compiled for each
// instruction set.
#include <cstring>

#include "stages/geometry/blocks/kernels/kernels.h"

namespace lamina {
namespace {

/// Numbers that are worked on at once; processors with shorter registers take several.
using Sixteen = Nm __attribute__((vector_size(64)));
using Four = Nm __attribute__((vector_size(16)));
using EightHeights = std::uint32_t __attribute__((vector_size(32)));
using EightSums = std::uint64_t __attribute__((vector_size(64)));
using SixteenSteps = std::uint32_t __attribute__((vector_size(64)));
using SixteenBytes = std::uint8_t __attribute__((vector_size(16)));

/// The least and the greatest of each facet's three numbers.
LAMINA_BODY void extremes_of_facets(const Nm (&corner)[3][kClusterSize], Sixteen& lo, Sixteen& hi) {
  Sixteen row[3];
  std::memcpy(row, corner, sizeof row);
  const Sixteen lo_of_two = row[0] < row[1] ? row[0] : row[1], hi_of_two = row[0] < row[1] ? row[1] : row[0];
  lo = lo_of_two < row[2] ? lo_of_two : row[2];
  hi = hi_of_two < row[2] ? row[2] : hi_of_two;
}

/// The four that are lowest and highest in every fourth lane.
LAMINA_BODY void extremes(const Sixteen& lo, const Sixteen& hi, Four& lowest, Four& highest) {
  Four low[4], high[4];
  std::memcpy(low, &lo, sizeof low);
  std::memcpy(high, &hi, sizeof high);
  for (std::uint32_t i = 0; i < 2; ++i) {
    low[i] = low[i] < low[i + 2] ? low[i] : low[i + 2];
    high[i] = high[i] < high[i + 2] ? high[i + 2] : high[i];
  }
  lowest = low[0] < low[1] ? low[0] : low[1];
  highest = high[0] < high[1] ? high[1] : high[0];
}

/// Columns of three rows as rows: x, y, z and x again.
LAMINA_BODY void turn(const Four& x, const Four& y, const Four& z, Four (&out)[4]) {
  const Four xy_low = __builtin_shufflevector(x, y, 0, 4, 1, 5), zx_low = __builtin_shufflevector(z, x, 0, 4, 1, 5);
  const Four xy_high = __builtin_shufflevector(x, y, 2, 6, 3, 7), zx_high = __builtin_shufflevector(z, x, 2, 6, 3, 7);
  out[0] = __builtin_shufflevector(xy_low, zx_low, 0, 1, 4, 5);
  out[1] = __builtin_shufflevector(xy_low, zx_low, 2, 3, 6, 7);
  out[2] = __builtin_shufflevector(xy_high, zx_high, 0, 1, 4, 5);
  out[3] = __builtin_shufflevector(xy_high, zx_high, 2, 3, 6, 7);
}

/// Adds up differences, which take all 32 bits.
LAMINA_BODY void add_heights(const Sixteen& lo, const Sixteen& hi, EightSums& sums) {
  const SixteenSteps height = (SixteenSteps)hi - (SixteenSteps)lo;
  EightHeights half[2];
  std::memcpy(half, &height, sizeof half);
  sums += __builtin_convertvector(half[0], EightSums) + __builtin_convertvector(half[1], EightSums);
}

LAMINA_BODY std::uint64_t bounds_body(std::span<const Cluster> clusters, Box* out) {
  EightSums heights = {};
  for (const Cluster& cluster : clusters) {
    Sixteen low_of[3], high_of[3];
    extremes_of_facets(cluster.x, low_of[0], high_of[0]);
    extremes_of_facets(cluster.y, low_of[1], high_of[1]);
    extremes_of_facets(cluster.z, low_of[2], high_of[2]);
    add_heights(low_of[2], high_of[2], heights);
    Four lo[3], hi[3], low[4], high[4];
    for (std::uint32_t k = 0; k < 3; ++k) extremes(low_of[k], high_of[k], lo[k], hi[k]);
    turn(lo[0], lo[1], lo[2], low);
    turn(hi[0], hi[1], hi[2], high);
    for (std::uint32_t i = 1; i < 4; ++i) {
      low[0] = low[0] < low[i] ? low[0] : low[i];
      high[0] = high[0] < high[i] ? high[i] : high[0];
    }
    *out++ = {{low[0][0], low[0][1], low[0][2]}, {high[0][0], high[0][1], high[0][2]}};
  }
  std::uint64_t sum = 0;
  for (std::uint32_t i = 0; i < 8; ++i) sum += heights[i];
  return sum;
}

LAMINA_BODY void index_body(std::span<const Cluster> clusters, const std::uint16_t* corners, std::uint32_t shift,
                            IndexedCluster* out) {
  for (const Cluster& cluster : clusters) {
    Sixteen lowest, highest;
    extremes_of_facets(cluster.z, lowest, highest);
    const Sixteen below = highest - 1, low = lowest >> static_cast<Nm>(shift);
    const SixteenSteps apart = (SixteenSteps)((lowest < below ? below : lowest) >> static_cast<Nm>(shift)) - (SixteenSteps)low;
    const SixteenSteps maximum = SixteenSteps{} + 255, span = apart < maximum ? apart : maximum;
    const SixteenBytes low_bytes = __builtin_convertvector((SixteenSteps)low, SixteenBytes),
                       span_bytes = __builtin_convertvector(span, SixteenBytes);
    std::memcpy(out->steps.low, &low_bytes, sizeof low_bytes);
    std::memcpy(out->steps.span, &span_bytes, sizeof span_bytes);
    std::memcpy(out->corner, corners, sizeof out->corner);
    corners += SortedBlock::kCorners;
    ++out;
  }
}

}  // namespace

#define LAMINA_BODIES(target, isa)                                                                                     \
  target std::uint64_t isa::bounds(std::span<const Cluster> clusters, Box* out) { return bounds_body(clusters, out); } \
  target void isa::index(std::span<const Cluster> clusters, const std::uint16_t* corners, std::uint32_t shift,         \
                         IndexedCluster* out) {                                                                        \
    index_body(clusters, corners, shift, out);                                                                         \
  }
LAMINA_BODIES(, plain)
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_BODIES(LAMINA_AVX2, avx2)
LAMINA_BODIES(LAMINA_AVX512, avx512)
#endif
#undef LAMINA_BODIES

}  // namespace lamina
