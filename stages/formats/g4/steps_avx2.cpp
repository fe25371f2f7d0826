// Steps of eight changes with AVX2. Words of neighbours are joined in two rounds: 2, then 4 changes a word.
//
// Whole numbers only: each change has the code word of table 1 that the way of all rows gives it, and joining words keeps their
// order. Columns are below 2^31, so that signed comparisons say what unsigned ones would.
#include <bit>

#include "stages/formats/g4/steps.h"
#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::formats::g4::avx2 {
namespace {

LAMINA_INLINE std::uint32_t bits_of(__m256i v) {
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(v)));
}

/// Joins the words of all lanes; a lane of length 0 has no word.
LAMINA_INLINE void join(__m256i code, __m256i length, Steps& steps) {
  const __m256i low = _mm256_set1_epi64x(0xFFFFFFFF);
  const __m256i odd = _mm256_srli_epi64(length, 32);
  const __m256i two = _mm256_or_si256(_mm256_sllv_epi64(_mm256_and_si256(code, low), odd), _mm256_srli_epi64(code, 32));
  const __m256i two_length = _mm256_add_epi64(_mm256_and_si256(length, low), odd);
  const __m256i right = _mm256_unpackhi_epi64(two_length, two_length);
  const __m256i four = _mm256_or_si256(_mm256_sllv_epi64(two, right), _mm256_unpackhi_epi64(two, two));
  const __m256i four_length = _mm256_add_epi64(two_length, right);
  steps.words[0] = static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm256_castsi256_si128(four)));
  steps.words[1] = static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm256_extracti128_si256(four, 1)));
  steps.lengths[0] = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm256_castsi256_si128(four_length)));
  steps.lengths[1] = static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm256_extracti128_si256(four_length, 1)));
}

}  // namespace

LAMINA_AVX2 void put_steps(BitWriter& writer, StepsTask& task, Steps& found) {
  const __m256i lane = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7), bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
  // Vertical modes 3 to the left .. 3 to the right. A row's end is a vertical mode of 0: a one.
  const __m256i code_of = _mm256_setr_epi32(2, 2, 2, 1, 3, 3, 3, 0), length_of = _mm256_setr_epi32(7, 6, 3, 1, 3, 6, 7, 0);
  const __m256i columns = _mm256_set1_epi32(static_cast<int>(task.columns));
  BitWriter out = writer;
  RowEnds row_ends = task.ends;
  const std::uint32_t* next_change = task.change;
  std::uint32_t left = task.left;
  for (; left != 0; next_change += 8, left -= 8, row_ends.advance_all()) {
    const __m256i all = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(std::min(left, 8u))), lane);
    const __m256i end = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(static_cast<int>(row_ends.bits())), bit), bit);
    const __m256i inner = _mm256_andnot_si256(end, all);
    const int* const at = reinterpret_cast<const int*>(next_change);
    const int* const above_at = at - task.changes;
    const __m256i change = _mm256_maskload_epi32(at, all), above = _mm256_maskload_epi32(above_at, all);
    const __m256i next = _mm256_maskload_epi32(at + 1, inner), next_above = _mm256_maskload_epi32(above_at + 1, inner);
    const __m256i before = _mm256_cmpgt_epi32(_mm256_blendv_epi8(next_above, columns, end), change);
    const __m256i overtaken = _mm256_andnot_si256(end, _mm256_cmpgt_epi32(above, next));
    const __m256i keeps = _mm256_and_si256(all, _mm256_andnot_si256(overtaken, before));
    const __m256i mode = _mm256_add_epi32(_mm256_sub_epi32(change, above), _mm256_set1_epi32(3));
    const __m256i far = _mm256_cmpeq_epi32(_mm256_max_epu32(mode, _mm256_set1_epi32(7)), mode);
    const __m256i ones = _mm256_srli_epi32(end, 31);
    const __m256i code = _mm256_or_si256(_mm256_sllv_epi32(_mm256_permutevar8x32_epi32(code_of, mode), ones), ones);
    const __m256i length = _mm256_add_epi32(_mm256_permutevar8x32_epi32(length_of, mode), ones);
    const std::uint32_t stops = bits_of(_mm256_andnot_si256(far, keeps)) ^ 0xFF;
    if (stops != 0) {
      found.keeps = bits_of(keeps);
      found.far = bits_of(_mm256_and_si256(all, far));
      found.count = static_cast<std::uint32_t>(std::countr_zero(stops));
      const __m256i taken = _mm256_cmpgt_epi32(_mm256_set1_epi32(static_cast<int>(found.count)), lane);
      join(_mm256_and_si256(taken, code), _mm256_and_si256(taken, length), found);
      break;
    }
    Steps steps;
    join(code, length, steps);
    put_words(out, steps);
  }
  writer = out;
  task.ends = row_ends;
  task.change = next_change;
  task.left = left;
}

}  // namespace lamina::formats::g4::avx2
#undef LAMINA_INLINE
#endif
