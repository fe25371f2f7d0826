// Filling with AVX2: the crossings of four rows of a segment at a time. Only their places are read and moved on as a vector:
// crossings of different rows lie apart, and a scatter of AVX-512 is no faster than single stores.
//
// The bits are those of plain::fill(): the same operations of IEEE 754 in the same order in each lane, and columns near a whole
// number go to the same integers.
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

namespace lamina::raster::avx2 {

void fill(const FillTask& task) {
  const __m256d undecided = _mm256_set1_pd(2 * task.sampling.near_x);
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
    const __m256d column = _mm256_set1_pd(columns[i]), slope = _mm256_set1_pd(slopes[i]);
    const __m128i enters = _mm_set1_epi32(static_cast<int>(rows.count_and_flags & SegmentRows::kEnters));
    std::uint32_t row = rows.first;
    for (std::uint32_t left = rows.count();; left -= 4, row += 4) {
      const __m256d centre = _mm256_cvtepi32_pd(_mm_loadu_si128(reinterpret_cast<const __m128i*>(centres + row)));
      const __m256d guess = _mm256_add_pd(column, _mm256_mul_pd(slope, centre));
      const __m128i whole = _mm256_cvttpd_epi32(guess);
      const __m256d beyond = _mm256_sub_pd(guess, _mm256_cvtepi32_pd(whole));
      const int near = _mm256_movemask_pd(_mm256_cmp_pd(beyond, undecided, _CMP_LT_OQ));
      auto value = reinterpret_cast<FourWords>(_mm_add_epi32(_mm_add_epi32(whole, whole), enters));
      if (near != 0) [[unlikely]] {
        if (rows.is(SegmentRows::kUpright)) {  // so are all its rows
          fill_exactly(task, i);
          break;
        }
        value = decide_near(task, i, row, left, static_cast<std::uint32_t>(near), value);
      }
      put_rows(crossing, positions + row, left, value);
      if (left <= 4) break;
    }
  }
}

}  // namespace lamina::raster::avx2
#endif
