// Eight lanes at a time, with AVX-512.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "stages/coverage/band/maker.h"
#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_TARGET LAMINA_AVX512
#define LAMINA_LANES LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::coverage::avx512 {
namespace {

using Eight = __m512d;
using Mask = __mmask8;

LAMINA_LANES Eight load(const double* at) { return _mm512_loadu_pd(at); }
LAMINA_LANES Eight all(double value) { return _mm512_set1_pd(value); }
LAMINA_LANES Eight plus(Eight a, Eight b) { return _mm512_add_pd(a, b); }
LAMINA_LANES Eight less(Eight a, Eight b) { return _mm512_sub_pd(a, b); }
LAMINA_LANES Eight times(Eight a, Eight b) { return _mm512_mul_pd(a, b); }
LAMINA_LANES Eight over(Eight a, Eight b) { return _mm512_div_pd(a, b); }
LAMINA_LANES Eight minimum(Eight a, Eight b) { return _mm512_min_pd(a, b); }
LAMINA_LANES Eight maximum(Eight a, Eight b) { return _mm512_max_pd(a, b); }
LAMINA_LANES Eight whole_below(Eight a) { return _mm512_floor_pd(a); }
LAMINA_LANES Eight nearest(Eight a) { return _mm512_roundscale_pd(a, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC); }
LAMINA_LANES Eight magnitude(Eight a) { return _mm512_abs_pd(a); }
LAMINA_LANES double lowest_of(Eight a) { return _mm512_reduce_min_pd(a); }
LAMINA_LANES double highest_of(Eight a) { return _mm512_reduce_max_pd(a); }
LAMINA_LANES Mask below(Eight a, Eight b) { return _mm512_cmp_pd_mask(a, b, _CMP_LT_OQ); }
LAMINA_LANES std::uint32_t bits(Mask mask) { return mask; }
LAMINA_LANES Eight pick(Mask mask, Eight a, Eight b) { return _mm512_mask_blend_pd(mask, b, a); }
LAMINA_LANES Eight keep(Mask mask, Eight a) { return _mm512_maskz_mov_pd(mask, a); }
LAMINA_LANES Eight drop(Mask mask, Eight a) { return _mm512_maskz_mov_pd(static_cast<Mask>(~mask), a); }
LAMINA_LANES Mask first_lanes(std::uint32_t count) { return static_cast<Mask>((1u << count) - 1); }
LAMINA_LANES void store(double* at, Eight a) { _mm512_storeu_pd(at, a); }
LAMINA_LANES void store_whole(std::uint32_t* at, Eight a) {
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(at), _mm512_cvttpd_epi32(a));
}
LAMINA_LANES std::uint64_t bytes_of(Eight a) {
  return static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm256_cvtepi32_epi8(_mm512_cvttpd_epi32(a))));
}
LAMINA_LANES void note_changes(std::uint64_t levels, std::uint32_t columns, std::uint32_t first, std::uint32_t& level,
                               Changes& changes) {
  const __m128i now = _mm_cvtsi64_si128(static_cast<long long>(levels));
  const __m128i before = _mm_cvtsi64_si128(static_cast<long long>(levels << 8 | level));
  const auto changed = static_cast<__mmask8>(_mm_cmpneq_epi8_mask(now, before) & ((1u << columns) - 1));
  const __m256i column =
      _mm256_add_epi32(_mm256_set1_epi32(static_cast<int>(first)), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(changes.column + changes.count), _mm256_maskz_compress_epi32(changed, column));
  const __m256i level_of = _mm256_maskz_compress_epi32(changed, _mm256_cvtepu8_epi32(now));
  _mm_storel_epi64(reinterpret_cast<__m128i*>(changes.level + changes.count), _mm256_cvtepi32_epi8(level_of));
  changes.count += static_cast<std::uint32_t>(std::popcount(static_cast<std::uint32_t>(changed)));
  level = levels >> (8 * (columns - 1)) & 255;
}

#include "stages/coverage/band/body.h"

}  // namespace

LAMINA_AVX512 void deposit(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells,
                           ColumnReach& reach, BandSums& sums) {
  add_body(piece, rows, columns, cells, reach, sums);
}
LAMINA_AVX512 void sweep(const BandTask& band, SweptBand& swept) { sweep_body(band, swept); }
LAMINA_AVX512 void split(const SweptBand& swept, Changes* rows) { split_body(swept, rows); }

}  // namespace lamina::coverage::avx512

LAMINA_AVX512_END
#undef LAMINA_LANES
#undef LAMINA_TARGET
#endif
