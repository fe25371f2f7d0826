// Tents of facets: one body, compiled for each instruction set: a loop over lanes that compilers turn into vectors. Whole
// numbers and IEEE 754's operations lane by lane, none of them fused (-ffp-contract=off), so that every width gives the same
// bits.
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <bit>

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster {
namespace {

// By value, so that nothing branches.
LAMINA_BODY std::int32_t lesser(std::int32_t a, std::int32_t b) { return a < b ? a : b; }
LAMINA_BODY std::int32_t greater(std::int32_t a, std::int32_t b) { return a < b ? b : a; }
/// The difference of any two heights; a facet too long for 32 bits wraps around.
LAMINA_BODY std::int32_t less(std::int32_t a, std::int32_t b) {
  return static_cast<std::int32_t>(static_cast<std::uint32_t>(a) - static_cast<std::uint32_t>(b));
}

/// The next float that has 11 bits: up to a thousandth more. Times up to 2^13 it is a float.
LAMINA_BODY float raised(float x) { return std::bit_cast<float>((std::bit_cast<std::int32_t>(x) + 0x1FFF) & ~0x1FFF); }

/// In float: rounding moves a tent's height by less than 2^-22 of the facet's depth, of which twice as much is added, and by
/// ten operations more, of 2^-24 each, for which 2^-20 is added. A vertex that counts as in the plane lengthens a cut by what the
/// longest edge does within kPlaneReach, and on its way down a tent counts as that much further up. A part of at least 2^-6 and of 11 bits is a multiple of 2^-16.
LAMINA_BODY void tents_body(const Sides& __restrict sides, std::uint32_t shift, std::int32_t first, Tents& __restrict tents) {
  constexpr float kRounding = 1.0f / (1 << 21), kUp = 1 + 1.0f / (1 << 20);
  constexpr float kMin = 1.0f / (1 << 6);
  const auto bits = static_cast<int>(shift);
  const float of_slope = 1 + static_cast<float>(kPlaneReach) / static_cast<float>(1 << bits);
  for (std::uint32_t i = 0; i < kClusterSize; ++i) {
    const Nm za = sides.z[0][i], zb = sides.z[1][i], zc = sides.z[2][i], ya = sides.y[0][i];
    const Nm lower = lesser(za, zb), upper = greater(za, zb);
    const Nm lo = lesser(lower, zc), hi = greater(upper, zc), middle = greater(lower, lesser(upper, zc));
    const std::int32_t count = lo < hi ? 1 : 0;
    const auto uy = static_cast<float>(less(sides.y[1][i], ya)), vy = static_cast<float>(less(sides.y[2][i], ya));
    const float area = __builtin_fabsf(uy * static_cast<float>(less(zc, za)) - static_cast<float>(less(zb, za)) * vy);
    const float depth = __builtin_fabsf(uy) + __builtin_fabsf(vy);
    const std::int32_t begin = (lo >> bits) - first, last = ((hi - count) >> bits) - first;
    const std::int32_t peak = lesser((middle >> bits) - first, last);
    const std::int32_t rise = greater(peak - begin, 1), fall = greater(last - peak, 1);
    const auto height = static_cast<float>(greater(less(hi, lo), 1));
    const float steep = area * of_slope + depth * (height * kRounding + kPlaneReach), whole = depth * height;
    const float top = (steep < whole ? steep : whole) * kUp;  // times the facet's height; no cut is longer than the facet
    const auto rises = static_cast<float>(rise), falls = static_cast<float>(fall);
    const float part = raised(top / (height * (rises * falls)) + kMin) * static_cast<float>(count);
    tents.begin[i] = begin;
    tents.end[i] = last + 1;
    tents.top[i] = begin + rise;
    tents.fall[i] = last + 2 - fall;
    tents.up[i] = part * falls;
    tents.down[i] = part * rises;
    tents.count[i] = count;
  }
}

#if defined(__SSE2__)
/// y and z of two vertices.
inline __m128 two_at(const std::uint16_t* corner, const Point3* vertices) {
  const __m128i one = _mm_loadl_epi64(reinterpret_cast<const __m128i*>(&vertices[corner[0]].y));
  const auto* const other = reinterpret_cast<const double*>(&vertices[corner[1]].y);
  return _mm_castpd_ps(_mm_loadh_pd(_mm_castsi128_pd(one), other));
}
#endif

}  // namespace

void plain::load_sides(const IndexedCluster& cluster, const Point3* vertices, Sides& sides) {
  for (std::uint32_t k = 0; k < 3; ++k) {
#if defined(__SSE2__)
    for (std::uint32_t i = 0; i < kClusterSize; i += 4) {
      const __m128 low = two_at(cluster.corner[k] + i, vertices), high = two_at(cluster.corner[k] + i + 2, vertices);
      _mm_store_ps(reinterpret_cast<float*>(sides.y[k] + i), _mm_shuffle_ps(low, high, _MM_SHUFFLE(2, 0, 2, 0)));
      _mm_store_ps(reinterpret_cast<float*>(sides.z[k] + i), _mm_shuffle_ps(low, high, _MM_SHUFFLE(3, 1, 3, 1)));
    }
#else
    for (std::uint32_t i = 0; i < kClusterSize; ++i) {
      const Point3& vertex = vertices[cluster.corner[k][i]];
      sides.y[k][i] = vertex.y;
      sides.z[k][i] = vertex.z;
    }
#endif
  }
}

void plain::raise_tents(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents) {
  tents_body(sides, shift, first, tents);
}
#if defined(LAMINA_WIDE_KERNELS)
void avx2::raise_tents(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents) {
  tents_body(sides, shift, first, tents);
}
void avx512::raise_tents(const Sides& sides, std::uint32_t shift, std::int32_t first, Tents& tents) {
  tents_body(sides, shift, first, tents);
}
#endif

}  // namespace lamina::raster
