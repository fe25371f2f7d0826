// Rows of crossings become changes, for any processor: short rows by networks of comparisons, which have no branch to guess,
// long ones by merging blocks of 16.
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster::plain {
namespace {

// --- 2^n crossings in order, by networks that have no branch.

/// Batcher's merge-exchange network for 2^n values: pairs to put in order, one after the other.
template <std::size_t kSize>
constexpr auto comparisons() {
  struct List {
    std::array<std::pair<std::size_t, std::size_t>, kSize * 4> pair{};
    std::size_t count = 0;
  } list;
  for (std::size_t p = 1; p < kSize; p *= 2) {
    for (std::size_t k = p; k >= 1; k /= 2) {
      for (std::size_t j = k % p; j + k < kSize; j += 2 * k) {
        for (std::size_t i = 0; i < k && i + j + k < kSize; ++i) {
          if ((i + j) / (2 * p) == (i + j + k) / (2 * p)) list.pair[list.count++] = {i + j, i + j + k};
        }
      }
    }
  }
  return list;
}

/// Sorts kSize crossings.
template <std::size_t kSize>
void sort_block(std::uint32_t* at) {
  static constexpr auto kNetwork = comparisons<kSize>();
  std::uint32_t value[kSize];
  std::copy_n(at, kSize, value);
  [&]<std::size_t... i>(std::index_sequence<i...>) {
    const auto in_order = [](std::uint32_t& a, std::uint32_t& b) {
      const std::uint32_t low = b < a ? b : a;
      b ^= a ^ low;  // g++ 12 forgets to exchange two values at -O3 if this is a maximum
      a = low;
    };
    (in_order(value[kNetwork.pair[i].first], value[kNetwork.pair[i].second]), ...);
  }
  (std::make_index_sequence<kNetwork.count>());
  std::copy_n(value, kSize, at);
}

#if defined(__SSE2__)
/// Four crossings a register, less 2^31: SSE2 compares numbers with a sign.
struct Fours {
  static __m128i load(const std::uint32_t* at) {
    return _mm_xor_si128(_mm_loadu_si128(reinterpret_cast<const __m128i*>(at)), _mm_set1_epi32(INT32_MIN));
  }
  static void store(std::uint32_t* at, __m128i v) {
    _mm_storeu_si128(reinterpret_cast<__m128i*>(at), _mm_xor_si128(v, _mm_set1_epi32(INT32_MIN)));
  }
  static __m128i reversed(__m128i v) { return _mm_shuffle_epi32(v, 0x1B); }

  /// The lesser of each lane into a, the greater into b.
  static void order(__m128i& a, __m128i& b) {
    const __m128i swap = _mm_and_si128(_mm_xor_si128(a, b), _mm_cmpgt_epi32(a, b));
    a = _mm_xor_si128(a, swap);
    b = _mm_xor_si128(b, swap);
  }

  /// Four registers, each of which is sorted then.
  static void sort_each(__m128i* v) {
    order(v[0], v[1]), order(v[2], v[3]), order(v[0], v[2]), order(v[1], v[3]), order(v[1], v[2]);
    const __m128i low = _mm_unpacklo_epi32(v[0], v[1]), low_2 = _mm_unpacklo_epi32(v[2], v[3]);
    const __m128i high = _mm_unpackhi_epi32(v[0], v[1]), high_2 = _mm_unpackhi_epi32(v[2], v[3]);
    v[0] = _mm_unpacklo_epi64(low, low_2), v[1] = _mm_unpackhi_epi64(low, low_2);
    v[2] = _mm_unpacklo_epi64(high, high_2), v[3] = _mm_unpackhi_epi64(high, high_2);
  }

  /// Two registers, each of which rises and then falls or the other way round, are sorted, each by itself.
  static void finish_two(__m128i& a, __m128i& b) {
    __m128i left = _mm_unpacklo_epi64(a, b), right = _mm_unpackhi_epi64(a, b);
    order(left, right);
    const __m128 low = _mm_castsi128_ps(left), high = _mm_castsi128_ps(right);
    __m128i even = _mm_castps_si128(_mm_shuffle_ps(low, high, 0x88)), odd = _mm_castps_si128(_mm_shuffle_ps(low, high, 0xDD));
    order(even, odd);  // lanes 0 of a, 0 of b, 2 of a, 2 of b, and those behind them
    const __m128i first = _mm_unpacklo_epi32(even, odd), second = _mm_unpackhi_epi32(even, odd);
    a = _mm_unpacklo_epi64(first, second);
    b = _mm_unpackhi_epi64(first, second);
  }

  /// Two sorted registers, merged.
  static void merge(__m128i& a, __m128i& b) {
    b = reversed(b);
    order(a, b);
    finish_two(a, b);
  }

  static void sort_sixteen(std::uint32_t* at) {
    __m128i v[4];
    for (std::size_t i = 0; i < 4; ++i) v[i] = load(at + 4 * i);
    sort_each(v);
    merge(v[0], v[1]);
    merge(v[2], v[3]);
    __m128i third = reversed(v[3]), fourth = reversed(v[2]);
    order(v[0], third), order(v[1], fourth);
    order(v[0], v[1]), order(third, fourth);
    finish_two(v[0], v[1]);
    finish_two(third, fourth);
    store(at, v[0]), store(at + 4, v[1]), store(at + 8, third), store(at + 12, fourth);
  }
};

template <>
void sort_block<16>(std::uint32_t* at) {
  Fours::sort_sixteen(at);
}
#endif

// --- rows.

constexpr std::uint32_t kBlockSize = 16;
constexpr std::uint32_t kBeyondAll = UINT32_MAX;  // no crossing is as large

/// Merges two sorted lists of one length from both ends at once: each end writes as many as a list has, so neither of them
/// leaves its list.
void merge_equal(const std::uint32_t* lists, std::size_t length, std::uint32_t* out) {
  const std::uint32_t *a = lists, *b = lists + length, *a_back = b - 1, *b_back = b + length - 1;
  std::uint32_t* back = out + 2 * length - 1;
  for (std::size_t i = 0; i < length; ++i) {
    const bool from_b = *b < *a;
    *out++ = from_b ? *b : *a;
    a += from_b ? 0 : 1;
    b += from_b ? 1 : 0;
    const bool back_from_a = *a_back > *b_back;
    *back-- = back_from_a ? *a_back : *b_back;
    a_back -= back_from_a ? 1 : 0;
    b_back -= back_from_a ? 0 : 1;
  }
}

/// Merges two sorted lists.
void merge_any(const std::uint32_t* a, const std::uint32_t* a_end, const std::uint32_t* b, const std::uint32_t* b_end,
               std::uint32_t* out) {
  while (a != a_end && b != b_end) {
    const bool from_b = *b < *a;
    *out++ = from_b ? *b : *a;
    a += from_b ? 0 : 1;
    b += from_b ? 1 : 0;
  }
  std::copy(b, b_end, std::copy(a, a_end, out));
}

/// Whether few crossings are more than a position or two away from where they belong, as in rows of many parts side by side.
bool is_nearly_sorted(const std::uint32_t* row, std::size_t count) {
  constexpr std::size_t kFar = 4;
  std::int32_t wrong = 0;
  for (std::size_t i = kFar; i < count; ++i) {
    wrong += static_cast<std::int32_t>(row[i - kFar]) > static_cast<std::int32_t>(row[i]) ? 1 : 0;
  }
  return wrong <= static_cast<std::int32_t>(count / 8);
}

/// Sorts by insertion, and gives up where crossings are far from their positions all the same, as in a row of two parts one
/// inside the other: each of them is in order, and half of all crossings would pass the other half.
bool insert_all(std::uint32_t* row, std::size_t count) {
  constexpr std::ptrdiff_t kMoves = 16;  // a crossing, as many as merging costs
  std::ptrdiff_t moves = static_cast<std::ptrdiff_t>(count) * kMoves;
  for (std::uint32_t* i = row + 1; i < row + count && moves >= 0; ++i) {
    const std::uint32_t value = *i;
    std::uint32_t* hole = i;
    for (; hole != row && hole[-1] > value; --hole) *hole = hole[-1];
    *hole = value;
    moves -= i - hole;
  }
  return moves >= 0;
}

/// Sorts blocks and merges them, from one of two buffers into the other. returns  where the row is then
std::uint32_t* sort_long(std::uint32_t* row, std::size_t count, std::uint32_t* other) {
  if (is_nearly_sorted(row, count) && insert_all(row, count)) return row;
  const std::size_t padded = (count + kBlockSize - 1) / kBlockSize * kBlockSize;
  std::fill(row + count, row + padded, kBeyondAll);
  for (std::size_t i = 0; i < padded; i += kBlockSize) sort_block<kBlockSize>(row + i);
  for (std::size_t length = kBlockSize; length < padded; length *= 2) {
    std::size_t i = 0;
    for (; i + 2 * length <= padded; i += 2 * length) merge_equal(row + i, length, other + i);
    if (i + length < padded) {
      merge_any(row + i, row + i + length, row + i + length, row + padded, other + i);
    } else {
      std::copy(row + i, row + padded, other + i);
    }
    std::swap(row, other);
  }
  return row;
}

/// Sorts up to kSize crossings and writes the row if it is its own changes, as are_changes() has it; else puts it back, sorted.
/// No branch depends on how many they are.
template <std::size_t kSize>
bool sort_short(std::uint32_t* row, std::uint32_t count, bool positive, std::uint32_t* change) {
  std::uint32_t value[kSize];
  for (std::uint32_t i = 0; i < kSize; ++i) value[i] = i < count ? row[i] : kBeyondAll;
  sort_block<kSize>(value);
  std::uint32_t bad = (count & 1) | (positive ? ~value[0] & 1 : 0);
  for (std::uint32_t i = 0; i + 1 < kSize; ++i) {
    const std::uint32_t both = value[i] ^ value[i + 1];
    bad |= (i + 1 < count ? 1 : 0) & (~both | (both < 2 ? 1 : 0));
  }
  const bool done = (bad & 1) == 0;
  std::uint32_t* const to = done ? change : row;
  const std::uint32_t shift = done ? 1 : 0;
  for (std::uint32_t i = 0; i < kSize; ++i) to[i] = value[i] >> shift;
  return done;
}

/// Whether directions alternate and no two crossings of a sorted row share a column: each of them is a change then, unless
/// what enters first is nothing to the rule.
bool are_changes(const std::uint32_t* row, std::uint32_t count) {
  std::uint32_t bad = (count & 1) != 0 ? 1 : 0;
  for (std::uint32_t i = 0; i + 1 < count; ++i) {
    const std::uint32_t both = row[i] ^ row[i + 1];
    bad |= (both ^ 1) & 1;
    bad |= both < 2 ? 1 : 0;
  }
  return bad == 0;
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
        done = sort_short<4>(sorted, count, positive, change);
      } else if (count <= 8) {
        done = sort_short<8>(sorted, count, positive, change);
      } else if (count <= kBlockSize) {
        done = sort_short<kBlockSize>(sorted, count, positive, change);
      } else {
        sorted = sort_long(sorted, count, change);
        done = are_changes(sorted, count) && (!positive || (*sorted & 1) != 0);
        if (done) std::transform(sorted, sorted + count, change, [](std::uint32_t crossing) { return crossing >> 1; });
      }
      change = done ? change + count : write_changes(task.rule, sorted, sorted + count, change);
    }
    *row_end++ = static_cast<std::uint32_t>(change - task.changes);
  }
  return change;
}

}  // namespace lamina::raster::plain
