// Sixteen lanes at a time, with AVX-512.
#include "stages/coverage/meet/facet_group.h"
#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_LANES LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::coverage::avx512 {
namespace {

constexpr std::uint32_t kLanes = 16;
using Ints = __m512i;
using Floats = __m512;

LAMINA_LANES Ints load(const Nm* at) { return _mm512_load_si512(at); }
LAMINA_LANES Floats load(const float* at) { return _mm512_load_ps(at); }
LAMINA_LANES Ints all(Nm value) { return _mm512_set1_epi32(value); }
LAMINA_LANES Floats all(float value) { return _mm512_set1_ps(value); }
LAMINA_LANES Floats zero() { return _mm512_setzero_ps(); }
LAMINA_LANES Ints less(Ints a, Ints b) { return _mm512_sub_epi32(a, b); }
LAMINA_LANES Floats floats(Ints a) { return _mm512_cvtepi32_ps(a); }
LAMINA_LANES Floats plus(Floats a, Floats b) { return _mm512_add_ps(a, b); }
LAMINA_LANES Floats less(Floats a, Floats b) { return _mm512_sub_ps(a, b); }
LAMINA_LANES Floats times(Floats a, Floats b) { return _mm512_mul_ps(a, b); }
LAMINA_LANES Floats absolute(Floats a) { return _mm512_abs_ps(a); }
LAMINA_LANES std::uint32_t not_above(Ints a, Ints b) { return _mm512_cmple_epi32_mask(a, b); }
LAMINA_LANES std::uint32_t equal(Ints a, Ints b) { return _mm512_cmpeq_epi32_mask(a, b); }
LAMINA_LANES std::uint32_t above(Floats a, Floats b) { return _mm512_cmp_ps_mask(a, b, _CMP_GT_OQ); }

#include "stages/coverage/meet/pairs_body.h"

}  // namespace

LAMINA_AVX512 std::uint32_t touching(const BoxLanes& boxes, const Box& box) { return touching_body(boxes, box); }
LAMINA_AVX512 void pairs(const FacetGroup& a, const FacetGroup& b, const Box& around_b, FoundPairs& found) {
  pairs_body(a, b, around_b, found);
}

}  // namespace lamina::coverage::avx512

LAMINA_AVX512_END
#undef LAMINA_LANES
#endif
