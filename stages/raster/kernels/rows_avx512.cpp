// Rows of crossings become changes, with AVX-512: up to 64 crossings are sorted in four registers, longer rows by merging
// blocks of 64, a register at a time.
//
// Whole numbers only: the sorted row is the same however it is sorted, and rows whose directions do not alternate take the
// same general path (bodies.h).
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_TARGET LAMINA_AVX512
#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::raster::avx512 {
namespace {

constexpr std::uint32_t kLanes = 16;
using Register = __m512i;

LAMINA_INLINE Register load_row(const std::uint32_t* at) { return _mm512_loadu_si512(at); }
LAMINA_INLINE void store_row(std::uint32_t* at, Register v) { _mm512_storeu_si512(at, v); }
LAMINA_INLINE Register lesser_of(Register a, Register b) { return _mm512_min_epu32(a, b); }
LAMINA_INLINE Register greater_of(Register a, Register b) { return _mm512_max_epu32(a, b); }
LAMINA_INLINE Register halved(Register v) { return _mm512_srli_epi32(v, 1); }

/// Lane i changes places with lane i ^ kBit.
template <int kBit>
LAMINA_INLINE __m512i partner(__m512i v) {
  if constexpr (kBit == 1) return _mm512_shuffle_epi32(v, _MM_PERM_CDAB);
  if constexpr (kBit == 2) return _mm512_shuffle_epi32(v, _MM_PERM_BADC);
  if constexpr (kBit == 4) return _mm512_shuffle_i32x4(v, v, 0xB1);
  if constexpr (kBit == 8) return _mm512_shuffle_i32x4(v, v, 0x4E);
}

/// A step of Batcher's bitonic sorter: lanes i and i ^ kBit in order, rising where i & kFalls is 0.
template <int kBit, int kFalls>
LAMINA_INLINE __m512i step(__m512i v) {
  constexpr auto kGreater = [] {
    unsigned lanes = 0;
    for (unsigned i = 0; i < kLanes; ++i) lanes |= ((i & kBit) != 0) == ((i & kFalls) == 0) ? 1u << i : 0;
    return static_cast<__mmask16>(lanes);
  }();
  const __m512i other = partner<kBit>(v);
  return _mm512_mask_max_epu32(_mm512_min_epu32(v, other), kGreater, v, other);
}

LAMINA_INLINE __m512i merge_bitonic(__m512i v) { return step<1, 16>(step<2, 16>(step<4, 16>(step<8, 16>(v)))); }
LAMINA_INLINE __m512i sort_fours(__m512i v) { return step<1, 4>(step<2, 4>(step<1, 2>(v))); }
/// Merges fours, of which the second and the last fall.
LAMINA_INLINE __m512i merge_fours(__m512i v) { return merge_bitonic(step<1, 8>(step<2, 8>(step<4, 8>(v)))); }
LAMINA_INLINE __m512i sort_register(__m512i v) { return merge_fours(sort_fours(v)); }

LAMINA_INLINE __m512i reversed(__m512i v) {
  return _mm512_permutexvar_epi32(_mm512_set_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15), v);
}

/// Merges fours that rise.
LAMINA_INLINE __m512i merge_rising_fours(__m512i v) {
  return merge_fours(_mm512_mask_shuffle_epi32(v, 0xF0F0, v, _MM_PERM_ABCD));
}
/// Columns of four registers become fours of one.
LAMINA_INLINE void turn_fours(__m512i (&v)[4]) {
  const __m512i low = _mm512_unpacklo_epi32(v[0], v[1]), low_2 = _mm512_unpacklo_epi32(v[2], v[3]);
  const __m512i high = _mm512_unpackhi_epi32(v[0], v[1]), high_2 = _mm512_unpackhi_epi32(v[2], v[3]);
  v[0] = _mm512_unpacklo_epi64(low, low_2), v[1] = _mm512_unpackhi_epi64(low, low_2);
  v[2] = _mm512_unpacklo_epi64(high, high_2), v[3] = _mm512_unpackhi_epi64(high, high_2);
}

/// Which of a register's crossings and their followers are not two changes, as are_changes() in rows_plain.cpp has it.
LAMINA_INLINE __mmask16 bad_pairs(__m512i v, __m512i next) {
  const __m512i both = _mm512_xor_si512(v, next);
  return static_cast<__mmask16>(_mm512_testn_epi32_mask(both, _mm512_set1_epi32(1)) |
                                _mm512_cmplt_epu32_mask(both, _mm512_set1_epi32(2)));
}

#include "stages/raster/kernels/rows_body.h"

/// sort_register() in half a register, in six steps instead of ten.
template <int kBit, int kFalls>
LAMINA_INLINE __m256i step_half(__m256i v) {
  constexpr auto kGreater = [] {
    unsigned lanes = 0;
    for (unsigned i = 0; i < kLanes / 2; ++i) lanes |= ((i & kBit) != 0) == ((i & kFalls) == 0) ? 1u << i : 0;
    return static_cast<__mmask8>(lanes);
  }();
  const __m256i other = kBit == 1   ? _mm256_shuffle_epi32(v, _MM_PERM_CDAB)
                        : kBit == 2 ? _mm256_shuffle_epi32(v, _MM_PERM_BADC)
                                    : _mm256_permute4x64_epi64(v, 0x4E);
  return _mm256_mask_max_epu32(_mm256_min_epu32(v, other), kGreater, v, other);
}
LAMINA_INLINE __m256i sort_half(__m256i v) {
  const __m256i fours = step_half<1, 4>(step_half<2, 4>(step_half<1, 2>(v)));
  return step_half<1, 8>(step_half<2, 8>(step_half<4, 8>(fours)));
}

/// The lowest `count` lanes.
LAMINA_INLINE __mmask16 lowest(std::uint32_t count) { return static_cast<__mmask16>(_bzhi_u32(0xFFFF, count)); }

/// Sorts up to eight crossings and writes the row if it is its own changes; else puts it back, sorted. It is written before
/// that is known, so that no address waits for the sorting.
LAMINA_AVX512 bool sort_eight(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  const __m256i none = _mm256_set1_epi32(-1);
  const __m256i v = sort_half(_mm256_mask_loadu_epi32(none, static_cast<__mmask8>(lowest(count)), row));
  const __m256i both = _mm256_xor_si256(v, _mm256_alignr_epi32(none, v, 1));
  std::uint32_t bad = _mm256_testn_epi32_mask(both, _mm256_set1_epi32(1)) | _mm256_cmplt_epu32_mask(both, _mm256_set1_epi32(2));
  bad = _bzhi_u32(bad, count - 1) | (count & 1);
  if (positive) bad |= ~static_cast<std::uint32_t>(_mm256_cvtsi256_si32(v)) & 1;
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(change), _mm256_srli_epi32(v, 1));
  if (bad == 0) [[likely]]
    return true;
  _mm256_storeu_si256(reinterpret_cast<__m256i*>(row), v);
  return false;
}

/// The same for up to four, in three steps instead of six.
LAMINA_INLINE bool sort_four(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  const __m128i none = _mm_set1_epi32(-1);
  const auto in_order = [](__m128i v, __m128i other, __mmask8 greater)
                            LAMINA_AVX512 { return _mm_mask_max_epu32(_mm_min_epu32(v, other), greater, v, other); };
  __m128i v = _mm_mask_loadu_epi32(none, static_cast<__mmask8>(_bzhi_u32(15, count)), row);
  v = in_order(v, _mm_shuffle_epi32(v, 0xB1), 0b1010);
  v = in_order(v, _mm_shuffle_epi32(v, 0x1B), 0b1100);
  v = in_order(v, _mm_shuffle_epi32(v, 0xB1), 0b1010);
  const __m128i both = _mm_xor_si128(v, _mm_alignr_epi32(none, v, 1));
  std::uint32_t bad = _mm_testn_epi32_mask(both, _mm_set1_epi32(1)) | _mm_cmplt_epu32_mask(both, _mm_set1_epi32(2));
  bad = _bzhi_u32(bad, count - 1) | (count & 1);
  if (positive) bad |= ~static_cast<std::uint32_t>(_mm_cvtsi128_si32(v)) & 1;
  _mm_storeu_si128(reinterpret_cast<__m128i*>(change), _mm_srli_epi32(v, 1));
  if (bad == 0) [[likely]]
    return true;
  _mm_storeu_si128(reinterpret_cast<__m128i*>(row), v);
  return false;
}

/// Sorts up to 16 * kRegisters crossings and writes the row if it is its own changes; else puts it back, sorted.
template <std::uint32_t kRegisters>
LAMINA_AVX512 bool sort_in_registers(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  const __m512i none = _mm512_set1_epi32(-1);
  __m512i v[kRegisters];
  for (std::uint32_t k = 0; k < kRegisters; ++k) {
    const std::uint32_t from = k * kLanes;
    v[k] = _mm512_mask_loadu_epi32(none, lowest(count > from ? std::min(count - from, kLanes) : 0), row + from);
  }
  if constexpr (kRegisters == 1) {
    v[0] = sort_register(v[0]);
  } else if constexpr (kRegisters == 2) {
    v[0] = sort_register(v[0]), v[1] = sort_register(v[1]);
    merge_two(v[0], v[1]);
  } else {
    sort_four_registers(v);
  }
  // The last crossing has no follower; beyond it values are equal.
  std::uint64_t bad = 0;
  for (std::uint32_t k = 0; k < kRegisters; ++k) {
    const __m512i next = _mm512_alignr_epi32(k + 1 < kRegisters ? v[(k + 1) % kRegisters] : none, v[k], 1);
    bad |= static_cast<std::uint64_t>(bad_pairs(v[k], next)) << 16 * k;
  }
  bad = _bzhi_u64(bad, count - 1) | (count & 1);
  if (positive) bad |= static_cast<std::uint64_t>(~_mm_cvtsi128_si32(_mm512_castsi512_si128(v[0]))) & 1;
  for (std::uint32_t k = 0; k < kRegisters; ++k) _mm512_storeu_si512(change + k * kLanes, _mm512_srli_epi32(v[k], 1));
  if (bad == 0) [[likely]]
    return true;
  for (std::uint32_t k = 0; k < kRegisters; ++k) _mm512_storeu_si512(row + k * kLanes, v[k]);
  return false;
}

LAMINA_INLINE bool sort_short(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  if (count <= 4) return sort_four(row, count, positive, change);
  if (count <= kLanes / 2) return sort_eight(row, count, positive, change);
  if (count <= kLanes) return sort_in_registers<1>(row, count, positive, change);
  if (count <= 2 * kLanes) return sort_in_registers<2>(row, count, positive, change);
  return sort_in_registers<4>(row, count, positive, change);
}

}  // namespace

std::uint32_t* rows(const RowsTask& task) { return rows_body(task); }

}  // namespace lamina::raster::avx512

LAMINA_AVX512_END
#undef LAMINA_INLINE
#undef LAMINA_TARGET
#endif
