#include "stages/write/png/filtered_rows.h"

#include <algorithm>

#include "stages/geometry/bits.h"

namespace lamina::write::png {
namespace {

constexpr unsigned kUp = 2;

/// Of one row, while it is written.
struct Row {
  const Codes& codes;
  std::uint64_t begin;  // of its bytes of bits in the stream
  std::uint32_t bytes;  // of bits
  std::span<const std::uint32_t> changes, above;
};

/// What moves on while a row is written. It is handed on by value, so that it can stay in registers.
struct State {
  BitWriter out;
  std::uint64_t written;                  // bytes of the stream; zeros may wait behind them
  std::uint64_t values = 0, moments = 0;  // as Adler32 has them, from the filter's byte on
  std::size_t next = 0, next_above = 0;   // changes
};

/// A zero, then matches, as long as it takes.
[[gnu::noinline]] BitWriter put_long_zeros(BitWriter out, const Codes& codes, std::uint64_t zeros) {
  const Word match = codes.match[kLongestMatch];
  const std::uint32_t most = BitWriter::kMostBits / match.length();
  Word matches;
  for (std::uint32_t i = 0; i < most; ++i) matches = join(matches, match);
  out.put(codes.byte[0]);
  for (--zeros; zeros >= most * kLongestMatch; zeros -= most * kLongestMatch) out.put(matches);
  const auto whole = static_cast<std::uint32_t>(zeros) / kLongestMatch, bits = whole * match.length();
  out.put(matches.bits() & ((std::uint64_t{1} << bits) - 1), bits);
  out.put(codes.more_zeros[zeros - whole * kLongestMatch]);
  return out;
}

/// Bytes of one value, which is not 0.
[[gnu::noinline]] BitWriter put_repeated(BitWriter out, const Codes& codes, std::uint32_t value, std::uint32_t count) {
  out.put(codes.byte[value]);
  for (--count; count >= kLongestMatch; count -= kLongestMatch) out.put(codes.match[kLongestMatch]);
  if (count >= kShortestMatch) {
    out.put(codes.match[count]);
    count = 0;
  }
  for (; count > 0; --count) out.put(codes.byte[value]);
  return out;
}

/// All zeros up to a place, then a word of one byte or two.
[[gnu::always_inline]] inline void put_at(State& state, const Codes& codes, std::uint64_t place, Word word,
                                          std::uint32_t bytes) {
  const std::uint64_t zeros = place - state.written;
  if (zeros < kShortZeros) [[likely]] {
    state.out.put(join(codes.zeros[zeros], word));
  } else {
    state.out = put_long_zeros(state.out, codes, zeros);
    state.out.put(word);
  }
  state.written = place + bytes;
}

/// Bytes `at` ... of one value, where one row is set and the other is not.
[[gnu::always_inline]] inline void put_apart(State& state, const Row& row, std::uint32_t at, std::uint32_t count,
                                             std::uint32_t value) {
  put_at(state, row.codes, row.begin + at, {}, count);
  state.out = put_repeated(state.out, row.codes, value, count);
  state.values += std::uint64_t{value} * count;
  state.moments += value * (std::uint64_t{count} * (at + 1) + std::uint64_t{count} * (count - 1) / 2);
}

std::uint32_t column_of(std::span<const std::uint32_t> changes, std::size_t next) {
  return next < changes.size() ? changes[next] : UINT32_MAX;
}

/// The sum of what the changes within byte `at` do to it; `next` is behind them afterwards.
inline std::uint32_t take_byte(std::span<const std::uint32_t> changes, std::size_t& next, std::uint32_t at) {
  std::uint32_t value = 0;
  for (; next < changes.size() && changes[next] / 8 == at; ++next) {
    const std::uint32_t ones = 0xFFu >> (changes[next] & 7);
    value += next % 2 == 0 ? ones : 0 - ones;
  }
  return value;
}

/// Any changes, byte by byte of those that hold one, until both rows have one colour again.
[[gnu::noinline]] State put_bytes(State state, const Row& row) {
  std::uint32_t between = 0;  // value of bytes without a change
  std::uint32_t next = 0;     // byte behind the last one of a change
  do {
    const std::uint32_t column = std::min(column_of(row.changes, state.next), column_of(row.above, state.next_above));
    const std::uint32_t at = std::min(column / 8, row.bytes);
    if (between != 0 && at > next) put_apart(state, row, next, at - next, between);
    std::uint32_t value = between + take_byte(row.changes, state.next, at);
    value = (value - take_byte(row.above, state.next_above, at)) & 0xFF;
    between = static_cast<std::uint32_t>(state.next_above % 2 - state.next % 2) & 0xFF;
    if (at == row.bytes) break;  // changes behind the last pixel
    if (value != 0) {
      put_at(state, row.codes, row.begin + at, row.codes.byte[value], 1);
      state.values += value;
      state.moments += std::uint64_t{value} * (at + 1);
    }
    next = at + 1;
  } while (between != 0);
  return state;
}

/// The next change of both rows, which have one colour before it and different columns, where it is an edge that moves a
/// little and no other change is near. returns  false if the change is another one
[[gnu::always_inline]] inline bool put_edge(State& state, const Row& row) {
  const std::uint32_t* const change = row.changes.data() + state.next;
  const std::uint32_t* const above = row.above.data() + state.next_above;
  const std::uint32_t shift = *change - *above + kMostShift;
  if (shift > 2 * kMostShift) return false;
  const std::uint32_t last = (std::max(*change, *above) - 1) | 7;  // of the last byte that differs
  if (state.next + 1 != row.changes.size() && change[1] <= last) return false;
  if (state.next_above + 1 != row.above.size() && above[1] <= last) return false;
  const EdgeWord& word = row.codes.edge[edge_index(state.next % 2 == 0, *above, shift)];
  const std::uint32_t at = std::min(*change, *above) / 8;
  const std::uint64_t zeros = row.begin + at - state.written;
  if (zeros < kShortZeros) [[likely]] {
    const Word before = row.codes.zeros[zeros];
    state.out.put(before.bits() | std::uint64_t{word.bits} << before.length(), before.length() + word.length);
  } else {
    state.out = put_long_zeros(state.out, row.codes, zeros);
    state.out.put(word.bits, word.length);
  }
  state.written += zeros + word.edge.bytes;
  const std::uint32_t values = std::uint32_t{word.edge.first} + word.edge.second;
  state.values += values;
  state.moments += std::uint64_t{values} * (at + 1) + word.edge.second;
  ++state.next, ++state.next_above;
  return true;
}

}  // namespace

FilteredRows::FilteredRows(const Codes& codes, std::uint32_t columns, std::uint32_t rows)
    : codes_(codes), row_bytes_(1 + row_bytes(columns)), rows_(rows), check_(row_bytes_, rows) {}

void FilteredRows::put_zeros(BitWriter& out, std::uint64_t zeros) {
  out = put_long_zeros(out, codes_, zeros);
  written_ += zeros;
}

void FilteredRows::put(BitWriter& out, std::uint32_t r, std::span<const std::uint32_t> changes,
                       std::span<const std::uint32_t> above) {
  const std::uint64_t start = r * row_bytes_;
  const Row row{codes_, start + 1, static_cast<std::uint32_t>(row_bytes_ - 1), changes, above};
  State state{out, written_};
  if (!above.empty()) {
    put_at(state, codes_, start, codes_.byte[kUp], 1);
    state.values = kUp;
  }
  while (state.next < changes.size() && state.next_above < above.size()) {
    if (changes[state.next] == above[state.next_above]) {
      ++state.next, ++state.next_above;
    } else if (!put_edge(state, row)) {
      state = put_bytes(state, row);
    }
  }
  while (state.next < changes.size() || state.next_above < above.size()) state = put_bytes(state, row);
  check_.add(state.values, state.moments, rows_ - r);
  written_ = state.written;
  out = state.out;
}

}  // namespace lamina::write::png
