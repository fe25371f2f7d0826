// Corners are matched eight at a time with AVX2.
//
// Whole numbers only: each lane reads and compares the same as plain::match().
#include "stages/geometry/blocks/kernels/kernels.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#include <bit>

#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::avx2 {
namespace {

constexpr std::uint32_t kLanes = 8;

LAMINA_INLINE __m256i load_shorts(const std::uint16_t* from) {
  return _mm256_cvtepu16_epi32(_mm_loadu_si128(reinterpret_cast<const __m128i*>(from)));
}

/// Where the z of corners lie: 96 numbers further for each cluster before them. Times 43691 / 2^21 is divided by 48, exactly
/// below 2^16.
LAMINA_INLINE __m256i slots_of(__m256i corner) {
  const __m256i cluster = _mm256_srli_epi32(_mm256_mulhi_epu16(corner, _mm256_set1_epi32(43691)), 5);
  return _mm256_add_epi32(corner, _mm256_add_epi32(_mm256_slli_epi32(cluster, 6), _mm256_slli_epi32(cluster, 5)));
}

LAMINA_INLINE __m256i unlike(const Nm* own, __m256i position, const Nm* coordinates) {
  return _mm256_xor_si256(_mm256_loadu_si256(reinterpret_cast<const __m256i*>(own)),
                          _mm256_i32gather_epi32(coordinates, position, 4));
}

LAMINA_INLINE unsigned bits_of(__m256i mask) { return static_cast<unsigned>(_mm256_movemask_ps(_mm256_castsi256_ps(mask))); }

/// Writes the numbers of the lanes that are set, counted from `first`, and something behind them.
LAMINA_INLINE void put_lanes(unsigned lanes, std::uint32_t first, std::uint16_t* to) {
  const std::uint64_t bytes = _pdep_u64(lanes, 0x0101010101010101) * 0xFF;
  const __m128i numbers = _mm_cvtsi64_si128(static_cast<long long>(_pext_u64(0x0706050403020100, bytes)));
  _mm_storeu_si128(reinterpret_cast<__m128i*>(to),
                   _mm_add_epi16(_mm_cvtepu8_epi16(numbers), _mm_set1_epi16(static_cast<short>(first))));
}

}  // namespace

void match(const SortedBlock& block, CornerMatches& matches) {
  constexpr std::uint32_t kY = SortedBlock::kCorners, kX = 2 * SortedBlock::kCorners;
  const Nm* const base = corner_at(block, 0);
  const __m256i lanes = _mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0);
  std::uint32_t rest = 0, found = 0;
  for (std::uint32_t c = 0, i = 0; c < block.clusters(); ++c) {
    const Nm* corner = corner_at(block, i);
    for (std::uint32_t k = 0; k < SortedBlock::kCorners; k += kLanes, i += kLanes, corner += kLanes) {
      const __m256i slot = _mm256_and_si256(load_shorts(block.hash.data() + i), _mm256_set1_epi32(CornerMatches::kSlots - 1));
      const __m256i first = _mm256_and_si256(_mm256_i32gather_epi32(reinterpret_cast<const int*>(matches.slot.data()), slot, 2),
                                             _mm256_set1_epi32(0xFFFF));
      const __m256i position = slots_of(first), own = _mm256_add_epi32(lanes, _mm256_set1_epi32(static_cast<int>(i)));
      const __m256i difference =
          _mm256_or_si256(_mm256_or_si256(unlike(corner, position, base), unlike(corner + kY, position, base + kY)),
                          unlike(corner + kX, position, base + kX));
      const __m256i packed = _mm256_permute4x64_epi64(_mm256_packus_epi32(first, first), 0x08);
      _mm_storeu_si128(reinterpret_cast<__m128i*>(matches.first.data() + i), _mm256_castsi256_si128(packed));
      const unsigned other = bits_of(_mm256_cmpeq_epi32(difference, _mm256_setzero_si256())) ^ 0xFF;
      put_lanes(other, i, matches.rest.data() + rest);
      rest += static_cast<std::uint32_t>(std::popcount(other));
      found += static_cast<std::uint32_t>(std::popcount(bits_of(_mm256_cmpeq_epi32(first, own))));
    }
  }
  matches.unmatched = rest;
  matches.found = found;
}

}  // namespace lamina::avx2

#undef LAMINA_INLINE
#endif
