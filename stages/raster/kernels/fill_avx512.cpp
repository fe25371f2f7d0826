// Filling with AVX-512: the crossings of eight rows of a segment at a time. A scatter is no faster than the single stores.
//
// The bits are those of plain::fill(): the same operations of IEEE 754 in the same order in each lane, and columns near a whole
// number go to the same integers.
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

LAMINA_AVX512_BEGIN

namespace lamina::raster::avx512 {

void fill(const FillTask& task) {
  const __m512d undecided = _mm512_set1_pd(2 * task.sampling.near_x);
  const Nm* const centres = task.sampling.row_centre.data();
  const SegmentRows* const all_rows = task.segments.rows.data();
  const double* const columns = task.segments.column.data();
  const double* const slopes = task.segments.columns_per_nm.data();
  std::uint32_t* const crossing = task.crossing;
  std::uint32_t* const positions = task.position - task.first_row;
  const std::size_t size = task.segments.size;
  for (std::size_t i = 0; i < size; ++i) {
    const SegmentRows rows = all_rows[i];
    if (rows.is(SegmentRows::kExact)) [[unlikely]] {
      fill_exactly(task, i);
      continue;
    }
    const __m512d column = _mm512_set1_pd(columns[i]), slope = _mm512_set1_pd(slopes[i]);
    const __m256i enters = _mm256_set1_epi32(static_cast<int>(rows.count_and_flags & SegmentRows::kEnters));
    std::uint32_t row = rows.first;
    for (std::uint32_t left = rows.count();; left -= 8, row += 8) {
      const __m512d centre = _mm512_cvtepi32_pd(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(centres + row)));
      const __m512d guess = _mm512_add_pd(column, _mm512_mul_pd(slope, centre));
      const __m256i whole = _mm512_cvttpd_epi32(guess);
      const __m512d beyond = _mm512_sub_pd(guess, _mm512_cvtepi32_pd(whole));
      const std::uint32_t near = _mm512_cmp_pd_mask(beyond, undecided, _CMP_LT_OQ);
      const __m256i value = _mm256_add_epi32(_mm256_add_epi32(whole, whole), enters);
      auto low = reinterpret_cast<FourWords>(_mm256_castsi256_si128(value));
      auto high = reinterpret_cast<FourWords>(_mm256_extracti128_si256(value, 1));
      if (near != 0) [[unlikely]] {
        if (rows.is(SegmentRows::kUpright)) {  // so are all its rows
          fill_exactly(task, i);
          break;
        }
        low = decide_near(task, i, row, left, near & 15, low);
        if (left > 4) high = decide_near(task, i, row + 4, left - 4, near >> 4, high);
      }
      put_rows(crossing, positions + row, left, low);
      if (left <= 4) break;
      put_rows(crossing, positions + row + 4, left - 4, high);
      if (left <= 8) break;
    }
  }
}

}  // namespace lamina::raster::avx512

LAMINA_AVX512_END
#endif
