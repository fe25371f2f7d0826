// Corners of a cluster are fetched eight at a time with AVX-512, y and z as one number of 64 bits.
//
// Nothing is computed: each lane gets the numbers that the plain loop does.
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

LAMINA_AVX512_BEGIN

namespace lamina::raster {

void avx512::load_sides(const IndexedCluster& cluster, const Point3* vertices, Sides& sides) {
  static_assert(sizeof(Point3) == 3 * sizeof(Nm));
  const __m512i even = _mm512_set_epi32(30, 28, 26, 24, 22, 20, 18, 16, 14, 12, 10, 8, 6, 4, 2, 0);
  const __m512i odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
  const Nm* const y = &vertices->y;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const __m512i number = _mm512_cvtepu16_epi32(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(cluster.corner[k])));
    const __m512i position = _mm512_add_epi32(number, _mm512_slli_epi32(number, 1));
    const __m512i low = _mm512_i32gather_epi64(_mm512_castsi512_si256(position), y, sizeof(Nm));
    const __m512i high = _mm512_i32gather_epi64(_mm512_extracti64x4_epi64(position, 1), y, sizeof(Nm));
    _mm512_store_si512(sides.y[k], _mm512_permutex2var_epi32(low, even, high));
    _mm512_store_si512(sides.z[k], _mm512_permutex2var_epi32(low, odd, high));
  }
}

}  // namespace lamina::raster

LAMINA_AVX512_END
#endif
