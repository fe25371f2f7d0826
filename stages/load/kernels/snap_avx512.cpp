// Coordinates are snapped eight at a time with AVX-512.
//
// Each lane does what plain::snap() does, and of that only one step rounds (kernels.h).
#include "stages/load/kernels/kernels.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::load::avx512 {
namespace {

constexpr std::size_t kFloats = 16;

LAMINA_INLINE __m256i snap_half(const float* in) {
  const __m512d nm = _mm512_mul_pd(_mm512_cvtps_pd(_mm256_loadu_ps(in)), _mm512_set1_pd(1e6));
  const __m512i rounding = _mm512_ternarylogic_epi64(_mm512_castpd_si512(nm), _mm512_set1_epi64(INT64_MIN),
                                                     _mm512_castpd_si512(_mm512_set1_pd(0.5)), 0xEA);
  return _mm512_cvttpd_epi32(_mm512_add_pd(nm, _mm512_castsi512_pd(rounding)));
}

/// Lowest and highest coordinates of three registers' lanes, and whether all are finite and within reach.
struct Extremes {
  std::array<float, 3 * kFloats> lo, hi;
  bool within_reach;
};

LAMINA_INLINE void inspection(const float* in, std::size_t count, Extremes& extremes) {
  const __m512 reach = _mm512_set1_ps(kReach);
  __m512 lo[3], hi[3];
  __mmask16 beyond{};
  for (std::size_t k = 0; k < 3; ++k) {
    lo[k] = _mm512_loadu_ps(extremes.lo.data() + k * kFloats);
    hi[k] = _mm512_loadu_ps(extremes.hi.data() + k * kFloats);
  }
  for (std::size_t i = 0; i < count; i += 3 * kFloats) {
    for (std::size_t k = 0; k < 3; ++k) {
      const __m512 at = _mm512_loadu_ps(in + i + k * kFloats);
      lo[k] = _mm512_min_ps(at, lo[k]);
      hi[k] = _mm512_max_ps(at, hi[k]);
      beyond =
          static_cast<__mmask16>(beyond | _mm512_cmp_ps_mask(_mm512_abs_ps(at), reach, _CMP_NLE_UQ));  // what is no number, too
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    _mm512_storeu_ps(extremes.lo.data() + k * kFloats, lo[k]);
    _mm512_storeu_ps(extremes.hi.data() + k * kFloats, hi[k]);
  }
  extremes.within_reach = beyond == 0;
}

}  // namespace

bool snap(const char* facets, std::size_t count, Triangle* out, CoordinateBox& box) {
  Extremes extremes;
  extremes.lo.fill(3e38f);
  extremes.hi.fill(-3e38f);
  std::array<float, kStripNumbers> corner;
  std::array<Nm, kStripNumbers> snapped;
  for (std::size_t first = 0; first < count; first += kStrip) {
    const std::size_t size = std::min(kStrip, count - first), numbers = take_strip<3 * kFloats>(facets, first, size, corner);
    inspection(corner.data(), numbers, extremes);
    if (!extremes.within_reach) return false;
    Nm* const to = size == kStrip ? &out[first].a.x : snapped.data();
    for (std::size_t i = 0; i < numbers; i += kFloats / 2) {
      _mm256_storeu_si256(reinterpret_cast<__m256i*>(to + i), snap_half(corner.data() + i));
    }
    if (size < kStrip) std::memcpy(&out[first].a.x, snapped.data(), 36 * size);
  }
  put_lanes(extremes.lo, extremes.hi, box);
  return true;
}

}  // namespace lamina::load::avx512

LAMINA_AVX512_END

#undef LAMINA_INLINE
#endif
