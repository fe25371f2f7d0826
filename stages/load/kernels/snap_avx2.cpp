// Coordinates are snapped four at a time with AVX2.
//
// Each lane does what plain::snap() does, and of that only one step rounds (kernels.h).
#include "stages/load/kernels/kernels.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::load::avx2 {
namespace {

constexpr std::size_t kFloats = 8;

LAMINA_INLINE __m128i snap_half(const float* in) {
  const __m256d nm = _mm256_mul_pd(_mm256_cvtps_pd(_mm_loadu_ps(in)), _mm256_set1_pd(1e6));
  const __m256d rounding = _mm256_or_pd(_mm256_and_pd(nm, _mm256_set1_pd(-0.0)), _mm256_set1_pd(0.5));
  return _mm256_cvttpd_epi32(_mm256_add_pd(nm, rounding));
}

/// Lowest and highest coordinates of three registers' lanes, and whether all are finite and within reach.
struct Extremes {
  std::array<float, 3 * kFloats> lo, hi;
  bool within_reach;
};

LAMINA_INLINE void inspection(const float* in, std::size_t count, Extremes& extremes) {
  const __m256 reach = _mm256_set1_ps(kReach);
  __m256 lo[3], hi[3];
  __m256 beyond{};
  for (std::size_t k = 0; k < 3; ++k) {
    lo[k] = _mm256_loadu_ps(extremes.lo.data() + k * kFloats);
    hi[k] = _mm256_loadu_ps(extremes.hi.data() + k * kFloats);
  }
  for (std::size_t i = 0; i < count; i += 3 * kFloats) {
    for (std::size_t k = 0; k < 3; ++k) {
      const __m256 at = _mm256_loadu_ps(in + i + k * kFloats);
      lo[k] = _mm256_min_ps(at, lo[k]);
      hi[k] = _mm256_max_ps(at, hi[k]);
      beyond = _mm256_or_ps(
          beyond, _mm256_cmp_ps(_mm256_andnot_ps(_mm256_set1_ps(-0.0f), at), reach, _CMP_NLE_UQ));  // what is no number, too
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    _mm256_storeu_ps(extremes.lo.data() + k * kFloats, lo[k]);
    _mm256_storeu_ps(extremes.hi.data() + k * kFloats, hi[k]);
  }
  extremes.within_reach = _mm256_movemask_ps(beyond) == 0;
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
      _mm_storeu_si128(reinterpret_cast<__m128i*>(to + i), snap_half(corner.data() + i));
    }
    if (size < kStrip) std::memcpy(&out[first].a.x, snapped.data(), 36 * size);
  }
  put_lanes(extremes.lo, extremes.hi, box);
  return true;
}

}  // namespace lamina::load::avx2

#undef LAMINA_INLINE
#endif
