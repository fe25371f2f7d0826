// Filling with AVX2: the crossings of four rows of a segment at a time. They are stored one by one: what one segment leaves in
// the places of its rows, the next may read at once, and the processor hands on single words sooner than parts of vectors.
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
  const FillTask band = task;  // nothing written can be a part of it
  for (std::size_t i = 0; i < task.segments.size; ++i) {
    const SegmentRows rows = all_rows[i];
    if (rows.is(SegmentRows::kExact | SegmentRows::kUpright)) {
      fill_exactly(task, i);
      continue;
    }
    const __m256d column = _mm256_set1_pd(columns[i]), slope = _mm256_set1_pd(slopes[i]);
    const __m128i enters = _mm_set1_epi32(rows.is(SegmentRows::kEnters) ? 1 : 0);
    std::uint32_t* place = task.place + (rows.first - task.first_row);
    std::uint32_t row = rows.first;
    for (std::uint32_t left = rows.count();; left -= 4, row += 4, place += 4) {
      const __m256d centre = _mm256_cvtepi32_pd(_mm_loadu_si128(reinterpret_cast<const __m128i*>(centres + row)));
      const __m256d guess = _mm256_add_pd(column, _mm256_mul_pd(slope, centre));
      const __m128i whole = _mm256_cvttpd_epi32(guess);
      const __m256d beyond = _mm256_sub_pd(guess, _mm256_cvtepi32_pd(whole));
      const int near = _mm256_movemask_pd(_mm256_cmp_pd(beyond, undecided, _CMP_LT_OQ));
      alignas(16) std::uint32_t value[4];
      _mm_store_si128(reinterpret_cast<__m128i*>(value), _mm_add_epi32(_mm_add_epi32(whole, whole), enters));
      if (near != 0) [[unlikely]] {
        for (std::uint32_t k = 0; k < 4; ++k) {
          if ((near >> k & 1) != 0 && k < left) value[k] = exact_crossing(task, i, row + k);
        }
      }
      put_four(band, place, left, value);
      if (left <= 4) break;
    }
  }
}

}  // namespace lamina::raster::avx2
#endif
