// Two lanes at a time, on any processor.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "stages/coverage/band/maker.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#define LAMINA_TARGET
#define LAMINA_LANES __attribute__((always_inline)) inline

namespace lamina::coverage::plain {
namespace {

#if defined(__SSE2__)
using Part = __m128d;
LAMINA_LANES Part min_of(Part a, Part b) { return _mm_min_pd(a, b); }
LAMINA_LANES Part max_of(Part a, Part b) { return _mm_max_pd(a, b); }
LAMINA_LANES std::uint32_t signs_of(Part a) { return static_cast<std::uint32_t>(_mm_movemask_pd(a)); }
#else
using Part = double __attribute__((vector_size(16)));
LAMINA_LANES Part min_of(Part a, Part b) { return a < b ? a : b; }
LAMINA_LANES Part max_of(Part a, Part b) { return a > b ? a : b; }
LAMINA_LANES std::uint32_t signs_of(Part a) { return (std::signbit(a[0]) ? 1u : 0) | (std::signbit(a[1]) ? 2u : 0); }
#endif

#include "stages/coverage/band/parts.h"

#include "stages/coverage/band/body.h"

}  // namespace

void deposit(const Trapezoid& piece, const BandRows& rows, const Edges& columns, BandCells& cells, ColumnReach& reach,
             BandSums& sums) {
  add_body(piece, rows, columns, cells, reach, sums);
}
void sweep(const BandTask& band, SweptBand& swept) { sweep_body(band, swept); }
void split(const SweptBand& swept, Changes* rows) { split_body(swept, rows); }

}  // namespace lamina::coverage::plain

#undef LAMINA_LANES
#undef LAMINA_TARGET
