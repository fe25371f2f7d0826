// Rows of crossings become changes, with AVX2: up to 32 crossings are sorted in four registers, longer rows by merging
// blocks of 32, a register at a time.
//
// Whole numbers only: the sorted row is the same however it is sorted, and rows whose directions do not alternate take the
// same general path (bodies.h).
#include "stages/raster/kernels/bodies.h"

#if defined(LAMINA_WIDE_KERNELS)
#include <immintrin.h>

#define LAMINA_INLINE LAMINA_AVX2 __attribute__((always_inline)) inline

namespace lamina::raster::avx2 {
namespace {

constexpr std::uint32_t kLanes = 8;

LAMINA_INLINE __m256i load_row(const std::uint32_t* at) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)); }
LAMINA_INLINE void store_row(std::uint32_t* at, __m256i v) { _mm256_storeu_si256(reinterpret_cast<__m256i*>(at), v); }

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

/// Two sorted registers: the lesser half into a, the greater into b, both sorted.
LAMINA_INLINE void merge_two(__m256i& a, __m256i& b) {
  const __m256i other = reversed(b);
  b = merge_bitonic(_mm256_max_epu32(a, other));
  a = merge_bitonic(_mm256_min_epu32(a, other));
}

/// Two sorted lists of two registers each, merged.
LAMINA_INLINE void merge_four(__m256i (&v)[4]) {
  const __m256i third = reversed(v[3]), fourth = reversed(v[2]);
  const __m256i low = _mm256_min_epu32(v[0], third), low_2 = _mm256_min_epu32(v[1], fourth);
  const __m256i high = _mm256_max_epu32(v[0], third), high_2 = _mm256_max_epu32(v[1], fourth);
  v[0] = merge_bitonic(_mm256_min_epu32(low, low_2));
  v[1] = merge_bitonic(_mm256_max_epu32(low, low_2));
  v[2] = merge_bitonic(_mm256_min_epu32(high, high_2));
  v[3] = merge_bitonic(_mm256_max_epu32(high, high_2));
}

/// Sorts four registers as one list. Fours are sorted across registers first, where no lane has to move, and turned from
/// columns into rows: half the work of sorting them within each.
LAMINA_INLINE void sort_four_registers(__m256i (&v)[4]) {
  const auto in_order = [](__m256i& a, __m256i& b) LAMINA_AVX2 {
    const __m256i low = _mm256_min_epu32(a, b);
    b = _mm256_max_epu32(a, b);
    a = low;
  };
  in_order(v[0], v[1]), in_order(v[2], v[3]), in_order(v[0], v[2]), in_order(v[1], v[3]), in_order(v[1], v[2]);
  const __m256i low = _mm256_unpacklo_epi32(v[0], v[1]), low_2 = _mm256_unpacklo_epi32(v[2], v[3]);
  const __m256i high = _mm256_unpackhi_epi32(v[0], v[1]), high_2 = _mm256_unpackhi_epi32(v[2], v[3]);
  v[0] = _mm256_unpacklo_epi64(low, low_2), v[1] = _mm256_unpackhi_epi64(low, low_2);
  v[2] = _mm256_unpacklo_epi64(high, high_2), v[3] = _mm256_unpackhi_epi64(high, high_2);
  for (__m256i& one : v) one = merge_bitonic(_mm256_blend_epi32(one, _mm256_shuffle_epi32(one, 0x1B), 0xF0));
  merge_two(v[0], v[1]);
  merge_two(v[2], v[3]);
  merge_four(v);
}

/// Which of a register's crossings and their followers are not two changes, as are_changes() in rows_plain.cpp has it.
LAMINA_INLINE std::uint32_t bad_pairs(__m256i v, __m256i next) {
  const __m256i both = _mm256_xor_si256(v, next);
  const __m256i same_direction = _mm256_xor_si256(_mm256_slli_epi32(both, 31), _mm256_set1_epi32(INT32_MIN));
  const __m256i same_column = _mm256_cmpeq_epi32(_mm256_srli_epi32(both, 1), _mm256_setzero_si256());
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_castsi256_ps(_mm256_or_si256(same_direction, same_column))));
}

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

/// Merges two sorted lists of whole registers: the lesser eight of two registers are next, whatever comes.
LAMINA_AVX2 void merge_registers(const std::uint32_t* a, const std::uint32_t* a_end, const std::uint32_t* b,
                                 const std::uint32_t* b_end, std::uint32_t* out) {
  __m256i low = load_row(a), high = load_row(b);
  a += kLanes, b += kLanes;
  while (true) {
    merge_two(low, high);
    store_row(out, low);
    out += kLanes;
    if (a == a_end && b == b_end) break;
    const bool from_a = b == b_end || (a != a_end && *a < *b);
    low = load_row(from_a ? a : b);
    (from_a ? a : b) += kLanes;
  }
  store_row(out, high);
}

/// Sorts more than 32 crossings. returns  where they are then: in the row or in `other`
LAMINA_AVX2 std::uint32_t* sort_many(std::uint32_t* row, std::uint32_t count, std::uint32_t* other) {
  constexpr std::uint32_t kBlock = 4 * kLanes;
  const std::uint32_t padded = (count + kBlock - 1) / kBlock * kBlock;
  std::fill(row + count, row + padded, UINT32_MAX);
  for (std::uint32_t i = 0; i < padded; i += kBlock) {
    __m256i v[4];
    for (std::uint32_t k = 0; k < 4; ++k) v[k] = load_row(row + i + k * kLanes);
    sort_four_registers(v);
    for (std::uint32_t k = 0; k < 4; ++k) store_row(row + i + k * kLanes, v[k]);
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
LAMINA_AVX2 bool write_alternating(const std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  std::uint32_t bad = (count & 1) | (positive ? ~*row & 1 : 0);
  for (std::uint32_t i = 0; i + 1 < count; i += kLanes) {
    bad |= _bzhi_u32(bad_pairs(load_row(row + i), load_row(row + i + 1)), std::min(count - 1 - i, kLanes));
  }
  if (bad != 0) return false;
  for (std::uint32_t i = 0; i < count; i += kLanes) {
    store_row(change + i, _mm256_srli_epi32(load_row(row + i), 1));
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

}  // namespace lamina::raster::avx2

#undef LAMINA_INLINE
#endif
