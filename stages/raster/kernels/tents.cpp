// One body, compiled for each instruction set: a loop over lanes that compilers turn into vectors. Whole numbers and IEEE 754's
// operations lane by lane, none of them fused (-ffp-contract=off), so that every width gives the same bits.
#include "stages/raster/kernels/tents.h"

#include "stages/geometry/targets.h"

namespace lamina::raster {
namespace {

// By value, so that nothing branches.
LAMINA_BODY std::int32_t lesser(std::int32_t a, std::int32_t b) { return a < b ? a : b; }
LAMINA_BODY std::int32_t greater(std::int32_t a, std::int32_t b) { return a < b ? b : a; }
/// The difference of any two heights; a facet too long for 32 bits wraps around.
LAMINA_BODY std::int32_t less(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b));
}

/// In float: rounding moves a tent's height by less than 2^-22 of the facet's depth, of which twice as much is added.
LAMINA_BODY void tents_body(const Cluster& __restrict cluster, std::uint32_t shift, std::int32_t first,
                            Tents& __restrict tents) {
  constexpr float kRounding = 1.0f / (1 << 21), kUp = 1 + 1.0f / (1 << 20);
  const auto bits = static_cast<int>(shift);
  for (std::uint32_t i = 0; i < kClusterSize; ++i) {
    const Nm za = cluster.z[0][i], zb = cluster.z[1][i], zc = cluster.z[2][i], ya = cluster.y[0][i];
    const Nm lower = lesser(za, zb), upper = greater(za, zb);
    const Nm lo = lesser(lower, zc), hi = greater(upper, zc), middle = greater(lower, lesser(upper, zc));
    const std::int32_t count = lo < hi ? 1 : 0;
    const auto uy = static_cast<float>(less(cluster.y[1][i], ya)), vy = static_cast<float>(less(cluster.y[2][i], ya));
    const float area = __builtin_fabsf(uy * static_cast<float>(less(zc, za)) - static_cast<float>(less(zb, za)) * vy);
    const float depth = __builtin_fabsf(uy) + __builtin_fabsf(vy);
    const float top = (area / static_cast<float>(greater(less(hi, lo), 1)) + depth * kRounding) * kUp;
    const float height = top * static_cast<float>(count);
    const std::int32_t begin = (lo >> bits) - first, last = ((hi - count) >> bits) - first;
    const std::int32_t peak = lesser((middle >> bits) - first, last);
    const std::int32_t rise = greater(peak - begin, 1), fall = greater(last - peak, 1);
    tents.begin[i] = begin;
    tents.last[i] = last;
    tents.rise[i] = rise;
    tents.fall[i] = fall;
    tents.up[i] = height / static_cast<float>(rise);
    tents.down[i] = height / static_cast<float>(fall);
    tents.count[i] = count;
  }
}

void tents_plain(const Cluster& cluster, std::uint32_t shift, std::int32_t first, Tents& tents) {
  tents_body(cluster, shift, first, tents);
}
#if defined(LAMINA_WIDE_KERNELS)
LAMINA_AVX2 void tents_avx2(const Cluster& cluster, std::uint32_t shift, std::int32_t first, Tents& tents) {
  tents_body(cluster, shift, first, tents);
}
LAMINA_AVX512 void tents_avx512(const Cluster& cluster, std::uint32_t shift, std::int32_t first, Tents& tents) {
  tents_body(cluster, shift, first, tents);
}
#endif

}  // namespace

RaiseTents* tents_for(Isa isa) {
#if defined(LAMINA_WIDE_KERNELS)
  if (isa == Isa::kAvx512) return tents_avx512;
  if (isa == Isa::kAvx2) return tents_avx2;
#endif
  static_cast<void>(isa);
  return tents_plain;
}

}  // namespace lamina::raster
