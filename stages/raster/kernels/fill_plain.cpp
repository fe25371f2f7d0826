// Filling, for any processor: four rows of a segment at a time.
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster::plain {

void fill(const FillTask& task) {
  const double undecided = 2 * task.sampling.near_x;
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
    const double column = columns[i], slope = slopes[i];
    const std::uint32_t enters = rows.count_and_flags & SegmentRows::kEnters;
    std::uint32_t row = rows.first;
    for (std::uint32_t left = rows.count();; left -= 4, row += 4) {
#if defined(__SSE2__)
      const __m128d all_columns = _mm_set1_pd(column), all_slopes = _mm_set1_pd(slope);
      const __m128i four = _mm_loadu_si128(reinterpret_cast<const __m128i*>(centres + row));
      const __m128d low = _mm_add_pd(all_columns, _mm_mul_pd(all_slopes, _mm_cvtepi32_pd(four)));
      const __m128d high = _mm_add_pd(all_columns, _mm_mul_pd(all_slopes, _mm_cvtepi32_pd(_mm_unpackhi_epi64(four, four))));
      const __m128i whole_low = _mm_cvttpd_epi32(low), whole_high = _mm_cvttpd_epi32(high);
      const __m128d limit = _mm_set1_pd(undecided);
      const __m128d near_low = _mm_cmplt_pd(_mm_sub_pd(low, _mm_cvtepi32_pd(whole_low)), limit);
      const __m128d near_high = _mm_cmplt_pd(_mm_sub_pd(high, _mm_cvtepi32_pd(whole_high)), limit);
      const int near = _mm_movemask_ps(_mm_shuffle_ps(_mm_castpd_ps(near_low), _mm_castpd_ps(near_high), 0x88));
      const __m128i whole = _mm_unpacklo_epi64(whole_low, whole_high);
      auto value =
          reinterpret_cast<FourWords>(_mm_add_epi32(_mm_add_epi32(whole, whole), _mm_set1_epi32(static_cast<int>(enters))));
#else
      FourWords value{};
      std::uint32_t near = 0;
      for (std::uint32_t k = 0; k < 4; ++k) {
        const double guess = column + slope * centres[row + k];
        const auto whole = static_cast<std::int32_t>(guess);
        near |= (guess - whole < undecided ? 1u : 0u) << k;
        value[k] = static_cast<std::uint32_t>(whole) * 2 + enters;
      }
#endif
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

}  // namespace lamina::raster::plain
