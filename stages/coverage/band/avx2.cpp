// Four lanes at a time, with AVX2.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "stages/coverage/band/maker.h"
#include "stages/geometry/targets.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_TARGET LAMINA_AVX2
#define LAMINA_LANES LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::coverage::avx2 {
namespace {

using Part = __m256d;
LAMINA_LANES Part min_of(Part a, Part b) { return _mm256_min_pd(a, b); }
LAMINA_LANES Part max_of(Part a, Part b) { return _mm256_max_pd(a, b); }
LAMINA_LANES std::uint32_t signs_of(Part a) { return static_cast<std::uint32_t>(_mm256_movemask_pd(a)); }

#include "stages/coverage/band/parts.h"

#include "stages/coverage/band/body.h"

}  // namespace

LAMINA_AVX2 void deposit(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells,
                         ColumnReach& reach, BandSums& sums) {
  add_body(piece, rows, columns, cells, reach, sums);
}
LAMINA_AVX2 void sweep(const BandTask& band, SweptBand& swept) { sweep_body(band, swept); }
LAMINA_AVX2 void split(const SweptBand& swept, Changes* rows) { split_body(swept, rows); }

}  // namespace lamina::coverage::avx2

#undef LAMINA_LANES
#undef LAMINA_TARGET
#endif
