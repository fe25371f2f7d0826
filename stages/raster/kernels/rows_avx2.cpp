// Rows of crossings become changes, with AVX2: up to 32 crossings are sorted in four registers, longer rows by merging
// blocks of 32, a register at a time.
//
// Whole numbers only: the sorted row is the same however it is sorted, and rows whose directions do not alternate take the
// same general path (bodies.h).
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_TARGET LAMINA_AVX2
#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::raster::avx2 {
namespace {

constexpr std::uint32_t kLanes = 8;
using Register = __m256i;

LAMINA_INLINE __m256i load_row(const std::uint32_t* at) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)); }
LAMINA_INLINE void store_row(std::uint32_t* at, __m256i v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(at), v); }

LAMINA_INLINE Register lesser_of(Register a, Register b) { return _mm256_min_epu32(a, b); }
LAMINA_INLINE Register greater_of(Register a, Register b) { return _mm256_max_epu32(a, b); }
LAMINA_INLINE Register halved(Register v) { return _mm256_srli_epi32(v, 1); }

/// Lane i changes places with lane i ^ kBit.
template <int kBit>
LAMINA_INLINE __m256i partner(__m256i v) {
  if constexpr (kBit == 1) return _mm256_shuffle_epi32(v, 0xB1);
  if constexpr (kBit == 2) return _mm256_shuffle_epi32(v, 0x4E);
  if constexpr (kBit == 4) return _mm256_permute2x128_si256(v, v, 1);
}

/// A step of Batcher's bitonic sorter: lanes i and i ^ kBit in order, rising where i & kFalls is 0.
template <int kBit, int kFalls>
LAMINA_INLINE __m256i step(__m256i v) {
  constexpr int kGreater = [] {
    int lanes = 0;
    for (int i = 0; i < 8; ++i) lanes |= ((i & kBit) != 0) == ((i & kFalls) == 0) ? 1 << i : 0;
    return lanes;
  }();
  const __m256i other = partner<kBit>(v);
  return _mm256_blend_epi32(_mm256_min_epu32(v, other), _mm256_max_epu32(v, other), kGreater);
}

LAMINA_INLINE __m256i merge_bitonic(__m256i v) { return step<1, 8>(step<2, 8>(step<4, 8>(v))); }
LAMINA_INLINE __m256i sort_fours(__m256i v) { return step<1, 4>(step<2, 4>(step<1, 2>(v))); }
LAMINA_INLINE __m256i sort_register(__m256i v) { return merge_bitonic(sort_fours(v)); }

LAMINA_INLINE __m256i reversed(__m256i v) { return _mm256_permutevar8x32_epi32(v, _mm256_set_epi32(0, 1, 2, 3, 4, 5, 6, 7)); }

/// Merges fours that rise.
LAMINA_INLINE __m256i merge_rising_fours(__m256i v) {
  return merge_bitonic(_mm256_blend_epi32(v, _mm256_shuffle_epi32(v, 0x1B), 0xF0));
}
/// Columns of four registers become fours of one.
LAMINA_INLINE void turn_fours(__m256i (&v)[4]) {
  const __m256i low = _mm256_unpacklo_epi32(v[0], v[1]), low_2 = _mm256_unpacklo_epi32(v[2], v[3]);
  const __m256i high = _mm256_unpackhi_epi32(v[0], v[1]), high_2 = _mm256_unpackhi_epi32(v[2], v[3]);
  v[0] = _mm256_unpacklo_epi64(low, low_2), v[1] = _mm256_unpackhi_epi64(low, low_2);
  v[2] = _mm256_unpacklo_epi64(high, high_2), v[3] = _mm256_unpackhi_epi64(high, high_2);
}

/// Which of a register's crossings and their followers are not two changes, as are_changes() in rows_plain.cpp has it.
LAMINA_INLINE std::uint32_t bad_pairs(__m256i v, __m256i next) {
  const __m256i both = _mm256_xor_si256(v, next);
  const __m256i same_direction = _mm256_xor_si256(_mm256_slli_epi32(both, 31), _mm256_set1_epi32(INT32_MIN));
  const __m256i same_column = _mm256_cmpeq_epi32(_mm256_srli_epi32(both, 1), _mm256_setzero_si256());
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_or_si256(same_direction, same_column))));
}

#include "stages/raster/kernels/rows_body.h"

/// Sorts up to 8 * kRegisters crossings and writes the row if it is its own changes; else puts it back, sorted.
template <std::uint32_t kRegisters>
LAMINA_AVX2 bool sort_in_registers(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  __m256i v[kRegisters];
  for (std::uint32_t k = 0; k < kRegisters; ++k) {
    const __m256i left = _mm256_set1_epi32(static_cast<int>(count - k * kLanes) - 1);
    const __m256i beyond = _mm256_cmpgt_epi32(_mm256_set_epi32(7, 6, 5, 4, 3, 2, 1, 0), left);
    v[k] = _mm256_or_si256(load_row(row + k * kLanes), beyond);
  }
  if constexpr (kRegisters == 1) {
    v[0] = count <= 4 ? sort_fours(v[0]) : sort_register(v[0]);
  } else if constexpr (kRegisters == 2) {
    v[0] = sort_register(v[0]), v[1] = sort_register(v[1]);
    merge_two(v[0], v[1]);
  } else {
    sort_four_registers(v);
  }
  // The last crossing has no follower; beyond it values are equal.
  std::uint32_t bad = 0;
  for (std::uint32_t k = 0; k < kRegisters; ++k) {
    const __m256i after = k + 1 < kRegisters ? v[(k + 1) % kRegisters] : v[k];
    const __m256i next =
        _mm256_permutevar8x32_epi32(_mm256_blend_epi32(v[k], after, 1), _mm256_set_epi32(0, 7, 6, 5, 4, 3, 2, 1));
    bad |= bad_pairs(v[k], next) << 8 * k;
  }
  bad = _bzhi_u32(bad, count - 1) | (count & 1);
  if (positive) bad |= ~static_cast<std::uint32_t>(_mm256_cvtsi256_si32(v[0])) & 1;
  const bool done = bad == 0;
  std::uint32_t* const to = done ? change : row;
  for (std::uint32_t k = 0; k < kRegisters; ++k) store_row(to + k * kLanes, done ? _mm256_srli_epi32(v[k], 1) : v[k]);
  return done;
}

LAMINA_INLINE bool sort_short(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  if (count <= kLanes) return sort_in_registers<1>(row, count, positive, change);
  if (count <= 2 * kLanes) return sort_in_registers<2>(row, count, positive, change);
  return sort_in_registers<4>(row, count, positive, change);
}

}  // namespace

std::uint32_t* rows(const RowsTask& task) { return rows_body(task); }

}  // namespace lamina::raster::avx2

#undef LAMINA_INLINE
#undef LAMINA_TARGET
#endif
