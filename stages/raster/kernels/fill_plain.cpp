// Filling, for any processor: four rows of a segment at a time, and no branch on how many of them it has.
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster::plain {

void fill(const FillTask& task) {
  const FillTask band = task;  // nothing written can be a part of it
  const double undecided = 2 * band.sampling.near_x;
  const Nm* const centres = band.sampling.row_centre.data();
  for (std::size_t i = 0; i < band.segments.size; ++i) {
    const SegmentRows rows = band.segments.rows[i];
    if (rows.is(SegmentRows::kExact | SegmentRows::kUpright)) {
      fill_exactly(task, i);
      continue;
    }
    const double column = band.segments.column[i], slope = band.segments.columns_per_nm[i];
    const std::uint32_t enters = rows.is(SegmentRows::kEnters) ? 1 : 0;
    std::uint32_t* place = band.place + (rows.first - band.first_row);
    std::uint32_t row = rows.first;
    for (std::uint32_t left = rows.count();; left -= 4, row += 4, place += 4) {
      std::uint32_t value[4];
      bool near = false;
#if defined(__SSE2__)
      const __m128d columns = _mm_set1_pd(column), slopes = _mm_set1_pd(slope);
      const __m128i four = _mm_loadu_si128(reinterpret_cast<const __m128i*>(centres + row));
      const __m128d low = _mm_add_pd(columns, _mm_mul_pd(slopes, _mm_cvtepi32_pd(four)));
      const __m128d high = _mm_add_pd(columns, _mm_mul_pd(slopes, _mm_cvtepi32_pd(_mm_unpackhi_epi64(four, four))));
      const __m128i whole_low = _mm_cvttpd_epi32(low), whole_high = _mm_cvttpd_epi32(high);
      const __m128d beyond =
          _mm_min_pd(_mm_sub_pd(low, _mm_cvtepi32_pd(whole_low)), _mm_sub_pd(high, _mm_cvtepi32_pd(whole_high)));
      const __m128i whole = _mm_unpacklo_epi64(whole_low, whole_high);
      _mm_storeu_si128(reinterpret_cast<__m128i*>(value),
                       _mm_add_epi32(_mm_add_epi32(whole, whole), _mm_set1_epi32(static_cast<int>(enters))));
      near = _mm_movemask_pd(_mm_cmplt_pd(beyond, _mm_set1_pd(undecided))) != 0;
#else
      for (std::uint32_t k = 0; k < 4; ++k) {
        const double guess = column + slope * centres[row + k];
        const auto whole = static_cast<std::int32_t>(guess);
        near |= guess - whole < undecided;
        value[k] = static_cast<std::uint32_t>(whole) * 2 + enters;
      }
#endif
      if (near) [[unlikely]] {
        for (std::uint32_t k = 0; k < std::min(left, 4u); ++k) {
          const double guess = column + slope * centres[row + k];
          if (guess - static_cast<std::int32_t>(guess) < undecided) value[k] = exact_crossing(task, i, row + k);
        }
      }
      put_four(band, place, left, value);
      if (left <= 4) break;
    }
  }
}

}  // namespace lamina::raster::plain
