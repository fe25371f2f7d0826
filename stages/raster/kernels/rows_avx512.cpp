// Rows of crossings become changes, with AVX-512: up to 64 crossings are sorted in four registers, longer rows by merging
// blocks of 64, a register at a time.
//
// Whole numbers only: the sorted row is the same however it is sorted, and rows whose directions do not alternate take the
// same general path (bodies.h).
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX512 __attribute__((always_inline)) inline

LAMINA_AVX512_BEGIN

namespace lamina::raster::avx512 {
namespace {

constexpr std::uint32_t kLanes = 16;

LAMINA_INLINE __m512i load16(const std::uint32_t* at) { return _mm512_loadu_si512(at); }

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

/// Two sorted registers: the lesser half into a, the greater into b, both sorted.
LAMINA_INLINE void merge_two(__m512i& a, __m512i& b) {
  const __m512i other = reversed(b);
  b = merge_bitonic(_mm512_max_epu32(a, other));
  a = merge_bitonic(_mm512_min_epu32(a, other));
}

/// Two sorted lists of two registers each, merged.
LAMINA_INLINE void merge_four(__m512i (&v)[4]) {
  const __m512i third = reversed(v[3]), fourth = reversed(v[2]);
  const __m512i low = _mm512_min_epu32(v[0], third), low_2 = _mm512_min_epu32(v[1], fourth);
  const __m512i high = _mm512_max_epu32(v[0], third), high_2 = _mm512_max_epu32(v[1], fourth);
  v[0] = merge_bitonic(_mm512_min_epu32(low, low_2));
  v[1] = merge_bitonic(_mm512_max_epu32(low, low_2));
  v[2] = merge_bitonic(_mm512_min_epu32(high, high_2));
  v[3] = merge_bitonic(_mm512_max_epu32(high, high_2));
}

/// Sorts four registers as one list. Fours are sorted across registers first, where no lane has to move, and turned from
/// columns into rows: half the work of sorting them within each.
LAMINA_INLINE void sort_four_registers(__m512i (&v)[4]) {
  const auto in_order = [](__m512i& a, __m512i& b) LAMINA_AVX512 {
    const __m512i low = _mm512_min_epu32(a, b);
    b = _mm512_max_epu32(a, b);
    a = low;
  };
  in_order(v[0], v[1]), in_order(v[2], v[3]), in_order(v[0], v[2]), in_order(v[1], v[3]), in_order(v[1], v[2]);
  const __m512i low = _mm512_unpacklo_epi32(v[0], v[1]), low_2 = _mm512_unpacklo_epi32(v[2], v[3]);
  const __m512i high = _mm512_unpackhi_epi32(v[0], v[1]), high_2 = _mm512_unpackhi_epi32(v[2], v[3]);
  v[0] = _mm512_unpacklo_epi64(low, low_2), v[1] = _mm512_unpackhi_epi64(low, low_2);
  v[2] = _mm512_unpacklo_epi64(high, high_2), v[3] = _mm512_unpackhi_epi64(high, high_2);
  for (__m512i& one : v) one = merge_fours(_mm512_mask_shuffle_epi32(one, 0xF0F0, one, _MM_PERM_ABCD));
  merge_two(v[0], v[1]);
  merge_two(v[2], v[3]);
  merge_four(v);
}

/// The same in half a register, in six steps instead of ten.
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

/// Which of a register's crossings and their followers are not two changes, as are_changes() in rows_plain.cpp has it.
LAMINA_INLINE __mmask16 bad_pairs(__m512i v, __m512i next) {
  const __m512i both = _mm512_xor_si512(v, next);
  return static_cast<__mmask16>(_mm512_testn_epi32_mask(both, _mm512_set1_epi32(1)) |
                                _mm512_cmplt_epu32_mask(both, _mm512_set1_epi32(2)));
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

/// Merges two sorted lists of whole registers: the lesser 16 of two registers are next, whatever comes.
LAMINA_AVX512 void merge_registers(const std::uint32_t* a, const std::uint32_t* a_end, const std::uint32_t* b,
                                   const std::uint32_t* b_end, std::uint32_t* out) {
  __m512i low = load16(a), high = load16(b);
  a += kLanes, b += kLanes;
  while (true) {
    merge_two(low, high);
    _mm512_storeu_si512(out, low);
    out += kLanes;
    if (a == a_end && b == b_end) break;
    const bool from_a = b == b_end || (a != a_end && *a < *b);
    low = load16(from_a ? a : b);
    (from_a ? a : b) += kLanes;
  }
  _mm512_storeu_si512(out, high);
}

/// Sorts more than 64 crossings. returns  where they are then: in the row or in `other`
LAMINA_AVX512 std::uint32_t* sort_many(std::uint32_t* row, std::uint32_t count, std::uint32_t* other) {
  constexpr std::uint32_t kBlock = 4 * kLanes;
  const std::uint32_t padded = (count + kBlock - 1) / kBlock * kBlock;
  std::fill(row + count, row + padded, UINT32_MAX);
  for (std::uint32_t i = 0; i < padded; i += kBlock) {
    __m512i v[4];
    for (std::uint32_t k = 0; k < 4; ++k) v[k] = load16(row + i + k * kLanes);
    sort_four_registers(v);
    for (std::uint32_t k = 0; k < 4; ++k) _mm512_storeu_si512(row + i + k * kLanes, v[k]);
  }
  for (std::uint32_t length = kBlock; length < padded; length *= 2) {
    for (std::uint32_t i = 0; i < padded; i += 2 * length) {
      const std::uint32_t middle = std::min(i + length, padded), end = std::min(i + 2 * length, padded);
      if (middle == end) {
        std::copy(row + i, row + end, other + i);
      } else {
        merge_registers(row + i, row + middle, row + middle, row + end, other + i);
      }
    }
    std::swap(row, other);
  }
  return row;
}

/// Writes a sorted row that is its own changes; false if it is not.
LAMINA_AVX512 bool write_alternating(const std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  std::uint32_t bad = (count & 1) | (positive ? ~*row & 1 : 0);
  for (std::uint32_t i = 0; i + 1 < count; i += kLanes) {
    bad |= bad_pairs(load16(row + i), load16(row + i + 1)) & lowest(std::min(count - 1 - i, kLanes));
  }
  if (bad != 0) return false;
  for (std::uint32_t i = 0; i < count; i += kLanes) {
    _mm512_storeu_si512(change + i, _mm512_srli_epi32(load16(row + i), 1));
  }
  return true;
}

}  // namespace

std::uint32_t* rows(const RowsTask& task) {
  std::uint32_t* change = task.change;
  std::uint32_t* row_end = task.row_end;
  const bool positive = task.rule == FillRule::kPositive;
  for (std::uint32_t row = task.rows; row-- > 0;) {
    const std::uint32_t first = row == 0 ? 0 : task.end[row - 1], count = task.end[row] - first;
    if (count != 0) {
      std::uint32_t* sorted = task.crossing + first;
      bool done;
      if (count == 2) {
        done = put_pair(sorted, positive, change);
        if (!done && sorted[1] < sorted[0]) std::swap(sorted[0], sorted[1]);
      } else if (count <= 4) {
        done = sort_four(sorted, count, positive, change);
      } else if (count <= kLanes / 2) {
        done = sort_eight(sorted, count, positive, change);
      } else if (count <= kLanes) {
        done = sort_in_registers<1>(sorted, count, positive, change);
      } else if (count <= 2 * kLanes) {
        done = sort_in_registers<2>(sorted, count, positive, change);
      } else if (count <= 4 * kLanes) {
        done = sort_in_registers<4>(sorted, count, positive, change);
      } else {
        sorted = sort_many(sorted, count, change);
        done = write_alternating(sorted, count, positive, change);
      }
      change = done ? change + count : write_changes(task.rule, sorted, sorted + count, change);
    }
    *row_end++ = static_cast<std::uint32_t>(change - task.changes);
  }
  return change;
}

}  // namespace lamina::raster::avx512

LAMINA_AVX512_END
#undef LAMINA_INLINE
#endif
