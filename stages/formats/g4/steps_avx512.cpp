// Steps of sixteen changes with AVX-512. Words of neighbours are joined in three rounds: 2, 4, then 8 changes a word.
//
// Whole numbers only: each change has the code word of table 1 that the way of all rows gives it, and joining words keeps their
// order.
#include <bit>

#include "stages/formats/g4/steps.h"
#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::formats::g4::avx512 {
namespace {

/// Joins the words of all lanes; a lane of length 0 has no word.
LAMINA_INLINE void join(__m512i code, __m512i length, Steps& steps) {
  const __m512i low = _mm512_set1_epi64(0xFFFFFFFF);
  const __m512i odd = _mm512_srli_epi64(length, 32);
  const __m512i two = _mm512_or_si512(_mm512_sllv_epi64(_mm512_and_si512(code, low), odd), _mm512_srli_epi64(code, 32));
  const __m512i two_length = _mm512_add_epi64(_mm512_and_si512(length, low), odd);
  const __m512i right = _mm512_unpackhi_epi64(two_length, two_length);
  const __m512i four = _mm512_or_si512(_mm512_sllv_epi64(two, right), _mm512_unpackhi_epi64(two, two));
  const __m512i four_length = _mm512_add_epi64(two_length, right);
  const __m512i last = _mm512_shuffle_i64x2(four_length, four_length, 0xB1);
  const __m512i eight = _mm512_or_si512(_mm512_sllv_epi64(four, last), _mm512_shuffle_i64x2(four, four, 0xB1));
  const __m512i eight_length = _mm512_add_epi64(four_length, last);
  steps.words[0] = static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm512_castsi512_si128(eight)));
  steps.words[1] = static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm512_extracti64x2_epi64(eight, 2)));
  steps.lengths[0] = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm512_castsi512_si128(eight_length)));
  steps.lengths[1] = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm512_extracti64x2_epi64(eight_length, 2)));
}

}  // namespace

LAMINA_AVX512 void put_steps(BitWriter& writer, StepsTask& task, Steps& found) {
  // Vertical modes 3 to the left .. 3 to the right; the upper half is followed by the row's end, a vertical mode of 0.
  const __m512i code_of = _mm512_setr_epi32(2, 2, 2, 1, 3, 3, 3, 0, 5, 5, 5, 3, 7, 7, 7, 0);
  const __m512i length_of = _mm512_setr_epi32(7, 6, 3, 1, 3, 6, 7, 0, 8, 7, 4, 2, 4, 7, 8, 0);
  const __m512i columns = _mm512_set1_epi32(static_cast<int>(task.columns));
  BitWriter out = writer;
  RowEnds row_ends = task.ends;
  const std::uint32_t* at = task.change;
  std::uint32_t left = task.left;
  for (; left != 0; at += 16, left -= 16, row_ends.advance_all()) {
    const auto all = static_cast<__mmask16>(left >= 16 ? 0xFFFF : (1u << left) - 1);
    const auto ends = static_cast<__mmask16>(row_ends.bits());
    const auto inner = static_cast<__mmask16>(all & ~ends);
    const std::uint32_t* const above_at = at - task.changes;
    const __m512i change = _mm512_maskz_loadu_epi32(all, at), above = _mm512_maskz_loadu_epi32(all, above_at);
    const __m512i next = _mm512_mask_loadu_epi32(_mm512_set1_epi32(-1), inner, at + 1);
    const __m512i next_above = _mm512_mask_loadu_epi32(columns, inner, above_at + 1);
    const __mmask16 keeps = _mm512_mask_cmpge_epu32_mask(_mm512_mask_cmpgt_epu32_mask(all, next_above, change), next, above);
    const __m512i mode = _mm512_add_epi32(_mm512_sub_epi32(change, above), _mm512_set1_epi32(3));
    const __mmask16 far = _mm512_mask_cmpgt_epu32_mask(all, mode, _mm512_set1_epi32(6));
    const __m512i index = _mm512_mask_add_epi32(mode, ends, mode, _mm512_set1_epi32(8));
    const std::uint32_t stops = (~std::uint32_t{keeps} & 0xFFFF) | far;
    if (stops != 0) {
      found.keeps = keeps;
      found.far = far;
      found.count = static_cast<std::uint32_t>(std::countr_zero(stops));
      const auto taken = static_cast<__mmask16>((1u << found.count) - 1);
      join(_mm512_maskz_permutexvar_epi32(taken, index, code_of), _mm512_maskz_permutexvar_epi32(taken, index, length_of),
           found);
      break;
    }
    Steps steps;
    join(_mm512_permutexvar_epi32(index, code_of), _mm512_permutexvar_epi32(index, length_of), steps);
    put_words(out, steps);
  }
  writer = out;
  task.ends = row_ends;
  task.change = at;
  task.left = left;
}

}  // namespace lamina::formats::g4::avx512

LAMINA_AVX512_END
#undef LAMINA_INLINE
#endif
