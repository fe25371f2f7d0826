// Rows of crossings become changes, for any processor: short rows by networks of comparisons, which have no branch to guess,
// long ones by merging blocks of 16.
#include <array>
#include <utility>

#include "stages/raster/kernels/bodies.h"

namespace lamina::raster::plain {
namespace {

constexpr std::uint32_t kBlockSize = 16;
constexpr std::uint32_t kBeyondAll = UINT32_MAX;  // no crossing is as large

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

/// Whether few crossings are more than a place or two away from where they belong, as in rows of many parts side by side.
bool is_nearly_sorted(const std::uint32_t* row, std::size_t count) {
  constexpr std::size_t kFar = 4;
  std::int32_t wrong = 0;
  for (std::size_t i = kFar; i < count; ++i) {
    wrong += static_cast<std::int32_t>(row[i - kFar]) > static_cast<std::int32_t>(row[i]) ? 1 : 0;
  }
  return wrong <= static_cast<std::int32_t>(count / 8);
}

/// Sorts by insertion, and gives up where crossings are far from their places all the same, as in a row of two parts one
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

/// Sorts one row; what lies behind it, up to kMoreCrossings, is overwritten. returns  where it is then
std::uint32_t* sort_row(std::uint32_t* row, std::uint32_t count, std::uint32_t* other) {
  if (count > kBlockSize) return sort_long(row, count, other);
  if (count == 2) {
    sort_block<2>(row);
    return row;
  }
  std::fill(row + count, row + kBlockSize, kBeyondAll);
  if (count <= 4) {
    sort_block<4>(row);
  } else if (count <= 8) {
    sort_block<8>(row);
  } else {
    sort_block<kBlockSize>(row);
  }
  return row;
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
  for (std::uint32_t row = task.rows; row-- > 0;) {
    const std::uint32_t first = row == 0 ? 0 : task.end[row - 1], count = task.end[row] - first;
    if (count != 0) {
      const std::uint32_t* const sorted = sort_row(task.crossing + first, count, change);
      if (are_changes(sorted, count) && (task.rule != FillRule::kPositive || (*sorted & 1) != 0)) [[likely]] {
        for (std::uint32_t i = 0; i < count; ++i) change[i] = sorted[i] >> 1;
        change += count;
      } else {
        change = write_changes(task.rule, sorted, sorted + count, change);
      }
    }
    *row_end++ = static_cast<std::uint32_t>(change - task.changes);
  }
  return change;
}

}  // namespace lamina::raster::plain
