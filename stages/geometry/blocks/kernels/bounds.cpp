// The boxes of clusters, 16 lanes at a time. One body in whole numbers, compiled for each instruction set.
#include <cstring>

#include "stages/geometry/blocks/kernels/kernels.h"

namespace lamina {
namespace {

/// Numbers that are worked on at once; processors with shorter registers take several.
using Sixteen = Nm __attribute__((vector_size(64)));
using Four = Nm __attribute__((vector_size(16)));

/// The four that are lowest and highest in every fourth lane of a coordinate.
LAMINA_BODY void extremes(const Nm (&corner)[3][kClusterSize], Four& lowest, Four& highest) {
  Sixteen row[3];
  std::memcpy(row, corner, sizeof row);
  const Sixteen lo_of_two = row[0] < row[1] ? row[0] : row[1], hi_of_two = row[0] < row[1] ? row[1] : row[0];
  const Sixteen lo = lo_of_two < row[2] ? lo_of_two : row[2], hi = hi_of_two < row[2] ? row[2] : hi_of_two;
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

LAMINA_BODY void bounds_body(std::span<const Cluster> clusters, Box* out) {
  for (const Cluster& cluster : clusters) {
    Four lo[3], hi[3], low[4], high[4];
    extremes(cluster.x, lo[0], hi[0]);
    extremes(cluster.y, lo[1], hi[1]);
    extremes(cluster.z, lo[2], hi[2]);
    turn(lo[0], lo[1], lo[2], low);
    turn(hi[0], hi[1], hi[2], high);
    for (std::uint32_t i = 1; i < 4; ++i) {
      low[0] = low[0] < low[i] ? low[0] : low[i];
      high[0] = high[0] < high[i] ? high[i] : high[0];
    }
    *out++ = {{low[0][0], low[0][1], low[0][2]}, {high[0][0], high[0][1], high[0][2]}};
  }
}

}  // namespace

void plain::bounds(std::span<const Cluster> clusters, Box* out) { bounds_body(clusters, out); }
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void avx2::bounds(std::span<const Cluster> clusters, Box* out) { bounds_body(clusters, out); }
LAMINA_AVX512 void avx512::bounds(std::span<const Cluster> clusters, Box* out) { bounds_body(clusters, out); }
#endif

}  // namespace lamina
