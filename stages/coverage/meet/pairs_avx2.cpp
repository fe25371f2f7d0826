// Eight lanes at a time, with AVX2.
#include "stages/coverage/meet/facet_group.h"
#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_LANES LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::coverage::avx2 {
namespace {

constexpr std::uint32_t kLanes = 8;
using Ints = __m256i;
using Floats = __m256;

LAMINA_LANES std::uint32_t bits(__m256 v) { return static_cast<std::uint32_t>(_mm256_movemask_ps(v)); }
LAMINA_LANES Ints load(const Nm* at) { return _mm256_load_si256(reinterpret_cast<const __m256i*>(at)); }
LAMINA_LANES Floats load(const float* at) { return _mm256_load_ps(at); }
LAMINA_LANES Ints all(Nm value) { return _mm256_set1_epi32(value); }
LAMINA_LANES Floats all(float value) { return _mm256_set1_ps(value); }
LAMINA_LANES Floats zero() { return _mm256_setzero_ps(); }
LAMINA_LANES Ints less(Ints a, Ints b) { return _mm256_sub_epi32(a, b); }
LAMINA_LANES Floats floats(Ints a) { return _mm256_cvtepi32_ps(a); }
LAMINA_LANES Floats plus(Floats a, Floats b) { return _mm256_add_ps(a, b); }
LAMINA_LANES Floats less(Floats a, Floats b) { return _mm256_sub_ps(a, b); }
LAMINA_LANES Floats times(Floats a, Floats b) { return _mm256_mul_ps(a, b); }
LAMINA_LANES Floats absolute(Floats a) { return _mm256_andnot_ps(_mm256_set1_ps(-0.0F), a); }
LAMINA_LANES std::uint32_t not_above(Ints a, Ints b) { return bits(_mm256_castsi256_ps(_mm256_cmpgt_epi32(a, b))) ^ 0xFF; }
LAMINA_LANES std::uint32_t equal(Ints a, Ints b) { return bits(_mm256_castsi256_ps(_mm256_cmpeq_epi32(a, b))); }
LAMINA_LANES std::uint32_t above(Floats a, Floats b) { return bits(_mm256_cmp_ps(a, b, _CMP_GT_OQ)); }

#include "stages/coverage/meet/pairs_body.h"

}  // namespace

LAMINA_AVX2 std::uint32_t touching(const BoxLanes& boxes, const Box& box) { return touching_body(boxes, box); }
LAMINA_AVX2 void pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found) {
  pairs_body(a, b, around_b, found);
}

}  // namespace lamina::coverage::avx2
#undef LAMINA_LANES
#endif
