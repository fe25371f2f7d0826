#include "stages/formats/png/image_data.h"

#include <algorithm>
#include <cstring>
#include <span>

#include "stages/formats/g4/encode.h"  // end_of_empty_rows()
#include "stages/geometry/bits.h"

namespace lamina::formats::png {
namespace {

// Rows of bits as what differs from the rows above them, deflated.
//
// A white row and a row below a white one have filter 0 (none), all others filter 2 (Up; PNG specification, section 9.2).
// So bytes are 0 but where a row changes, and an interval of white rows consists of zeros only. Zeros are never read: they are
// the distance between two bytes that are not 0.

constexpr unsigned kUp = 2;

/// Of one row, while it is written.
struct PngRow {
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
  const BitString match = codes.match[kLongestMatch];
  const std::uint32_t maximum = BitWriter::kMaxBits / match.length();
  BitString matches;
  for (std::uint32_t i = 0; i < maximum; ++i) matches = join(matches, match);
  out.put(codes.byte[0]);
  for (--zeros; zeros >= maximum * kLongestMatch; zeros -= maximum * kLongestMatch) out.put(matches);
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
[[gnu::always_inline]] inline void put_at(State& state, const Codes& codes, std::uint64_t position, BitString word,
                                          std::uint32_t bytes) {
  const std::uint64_t zeros = position - state.written;
  if (zeros < kShortZeros) [[likely]] {
    state.out.put(join(codes.zeros[zeros], word));
  } else {
    state.out = put_long_zeros(state.out, codes, zeros);
    state.out.put(word);
  }
  state.written = position + bytes;
}

/// Bytes `at` ... of one value, where one row is set and the other is not.
[[gnu::always_inline]] inline void put_apart(State& state, const PngRow& row, std::uint32_t at, std::uint32_t count,
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
[[gnu::noinline]] State put_bytes(State state, const PngRow& row) {
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

/// An edge that moves: its first byte that differs, and its edge_index() in the lowest 8 bits.
using MovedEdge = std::uint32_t;

constexpr MovedEdge moved_edge(std::uint32_t at, std::size_t index) { return at << 8 | static_cast<std::uint32_t>(index); }

[[gnu::always_inline]] inline void put_moved(State& state, const PngRow& row, MovedEdge moved) {
  const EdgeWord& word = row.codes.edge[moved & 0xFF];
  const std::uint32_t at = moved >> 8;
  const std::uint64_t zeros = row.begin + at - state.written;
  if (zeros < kShortZeros) [[likely]] {
    const BitString before = row.codes.zeros[zeros];
    state.out.put(before.bits() | std::uint64_t{word.bits} << before.length(), before.length() + word.length);
  } else {
    state.out = put_long_zeros(state.out, row.codes, zeros);
    state.out.put(word.bits, word.length);
  }
  state.written += zeros + word.edge.bytes;
  const std::uint32_t values = std::uint32_t{word.edge.first} + word.edge.second;
  state.values += values;
  state.moments += std::uint64_t{values} * (at + 1) + word.edge.second;
}

/// The next change of both rows, which have one colour before it and different columns, where it is an edge that moves a
/// little and no other change is near. returns  false if the change is another one
[[gnu::always_inline]] inline bool put_edge(State& state, const PngRow& row) {
  const std::uint32_t* const change = row.changes.data() + state.next;
  const std::uint32_t* const above = row.above.data() + state.next_above;
  const std::uint32_t shift = *change - *above + kMaxShift;
  if (shift > 2 * kMaxShift) return false;
  const std::uint32_t last = (std::max(*change, *above) - 1) | 7;  // of the last byte that differs
  if (state.next + 1 != row.changes.size() && change[1] <= last) return false;
  if (state.next_above + 1 != row.above.size() && above[1] <= last) return false;
  const std::uint32_t at = std::min(*change, *above) / 8;
  put_moved(state, row, moved_edge(at, edge_index(state.next % 2 == 0, *above, shift)));
  ++state.next, ++state.next_above;
  return true;
}

using FourInts [[gnu::vector_size(16)]] = std::int32_t;

FourInts four(const std::uint32_t* at) {
  FourInts value;
  std::memcpy(&value, at, sizeof value);
  return value;
}
FourInts less_of(FourInts a, FourInts b) { return (a & (a < b)) | (b & (a >= b)); }
FourInts more_of(FourInts a, FourInts b) { return (a & (a > b)) | (b & (a <= b)); }

constexpr std::size_t kChangesAtOnce = 32;
constexpr std::size_t kFewChanges = 16;  // less than that are taken one by one
constexpr std::size_t kNotEdges = kChangesAtOnce + 1;

/// Finds the edges that move among the next `count` changes of both rows, which have one colour before them. Edges that
/// move and edges that stay are mixed at random, so there is no branch between them: four are tested at once, and a hit
/// is kept by advancing the write position.
/// count    a multiple of 4, less than there are left in both rows
/// moved    room for as many
/// returns  how many move; kNotEdges if one moves too far or the change behind it is near
[[gnu::always_inline]] inline std::size_t find_moved(const State& state, const PngRow& row, std::size_t count,
                                                     MovedEdge* moved) {
  const std::uint32_t* const change = row.changes.data() + state.next;
  const std::uint32_t* const above = row.above.data() + state.next_above;
  const std::int32_t even = state.next % 2 == 0 ? 1 << 7 : 0, odd = even ^ 1 << 7;
  const FourInts begins = {even, odd, even, odd};
  FourInts stops = {0, 0, 0, 0};
  std::size_t found = 0;
  for (std::size_t i = 0; i < count; i += 4) {
    const FourInts a = four(change + i), b = four(above + i);
    const FourInts shift = a - b + kMaxShift, moves = a != b;
    const FourInts behind = (more_of(a, b) + 7) >> 3, next = less_of(four(change + i + 1), four(above + i + 1)) >> 3;
    stops |= (shift < 0) | (shift > 2 * kMaxShift) | (moves & (next < behind));
    const FourInts edges = (less_of(a, b) >> 3) << 8 | begins | (b & 7) << 4 | (shift & 15);
    for (int lane = 0; lane < 4; ++lane) {
      moved[found] = static_cast<MovedEdge>(edges[lane]);
      found += static_cast<std::uint32_t>(-moves[lane]);
    }
  }
  std::uint64_t halves[2];
  std::memcpy(halves, &stops, sizeof halves);
  return (halves[0] | halves[1]) == 0 ? found : kNotEdges;
}

/// The next changes of both rows, up to kChangesAtOnce, if all are edges that stand or move a little; or else none.
[[gnu::noinline]] State put_at_once(State state, const PngRow& row, std::size_t count) {
  MovedEdge moved[kChangesAtOnce + 1];
  const std::size_t found = find_moved(state, row, count, moved);
  if (found == kNotEdges) return state;
  for (std::size_t i = 0; i < found; ++i) put_moved(state, row, moved[i]);
  state.next += count, state.next_above += count;
  return state;
}

/// Changes of both rows one by one, up to number `end` of this row or the end of one of both.
[[gnu::always_inline]] inline void put_one_by_one(State& state, const PngRow& row, std::size_t end) {
  while (state.next < end && state.next_above < row.above.size()) {
    if (row.changes[state.next] == row.above[state.next_above]) {
      ++state.next, ++state.next_above;
    } else if (!put_edge(state, row)) {
      state = put_bytes(state, row);
    }
  }
}

/// Adler-32 (RFC 1950, section 8.2) of rows of one length. Its second sum counts each byte as often as there are bytes from
/// it to the end of the stream, so rows can be added up one by one, and zeros need not be.
class Adler32 {
 public:
  Adler32(std::uint64_t row_bytes, std::uint64_t rows) : row_bytes_(row_bytes), rows_(rows) {}

  /// values     sum of the bytes of a row; at most 2^27
  /// moments    sum of each of them times the bytes before it in the row; at most 2^45
  /// rows_left  this one and those below
  void add(std::uint64_t values, std::uint64_t moments, std::uint64_t rows_left) {
    values_ += values;
    weighted_ += values * rows_left;
    moments_ += moments;
    if (((weighted_ | moments_) >> 62) != 0) weighted_ %= kPrime, moments_ %= kPrime;
  }

  std::uint32_t value() const {
    const std::uint64_t length = row_bytes_ * rows_ % kPrime, first = (1 + values_) % kPrime;
    const std::uint64_t second = (length + weighted_ % kPrime * row_bytes_ + kPrime - moments_ % kPrime) % kPrime;
    return static_cast<std::uint32_t>(second << 16 | first);
  }

 private:
  static constexpr std::uint64_t kPrime = 65521;
  std::uint64_t row_bytes_, rows_;
  std::uint64_t values_ = 0, weighted_ = 0, moments_ = 0;
};

class FilteredRows {
 public:
  FilteredRows(const Codes& codes, std::uint32_t columns, std::uint32_t rows)
      : codes_(codes), row_bytes_(1 + row_bytes(columns)), rows_(rows), check_(row_bytes_, rows) {}

  /// Bytes that so many zeros take at most.
  static std::size_t max_bytes_of_zeros(std::uint64_t zeros) { return static_cast<std::size_t>(zeros / 128 + 32); }
  /// Bytes that put() writes at most for this many changes of a row and of the one above.
  std::size_t max_bytes(std::size_t changes) const {
    return 9 * changes + max_bytes_of_zeros(kMaxWaiting) + max_bytes_of_zeros(row_bytes_);
  }
  /// Zeros that wait to be written before this row.
  std::uint64_t waiting(std::uint32_t row) const { return row * row_bytes_ - written_; }
  /// Writes this many of them.
  void put_zeros(BitWriter& out, std::uint64_t zeros) {
    out = put_long_zeros(out, codes_, zeros);
    written_ += zeros;
  }

  /// Row number `r`, which is not white. Rows come from the top; white ones are left out.
  /// needs  at most kMaxWaiting zeros before the row
  static constexpr std::uint64_t kMaxWaiting = 32 * 1024;
  [[gnu::noinline]] void put(BitWriter& out, std::uint32_t r, std::span<const std::uint32_t> changes,
                             std::span<const std::uint32_t> above) {
    const std::uint64_t start = r * row_bytes_;
    const PngRow row{codes_, start + 1, static_cast<std::uint32_t>(row_bytes_ - 1), changes, above};
    State state{out, written_};
    if (!above.empty()) {
      put_at(state, codes_, start, codes_.byte[kUp], 1);
      state.values = kUp;
    }
    for (;;) {
      const std::size_t left = std::min(changes.size() - state.next, above.size() - state.next_above);
      if (left < kFewChanges) break;
      const std::size_t next = state.next, count = std::min(left - 1, kChangesAtOnce) & ~std::size_t{3};
      state = put_at_once(state, row, count);
      if (state.next == next) put_one_by_one(state, row, next + count);
    }
    put_one_by_one(state, row, changes.size());
    while (state.next < changes.size() || state.next_above < above.size()) state = put_bytes(state, row);
    check_.add(state.values, state.moments, rows_ - r);
    written_ = state.written;
    out = state.out;
  }

  std::uint32_t check() const { return check_.value(); }

 private:
  const Codes& codes_;
  std::uint64_t row_bytes_;  // of the stream: the filter's, then those of bits
  std::uint32_t rows_;
  std::uint64_t written_ = 0;
  Adler32 check_;
};

// White rows are cut here, so that a chunk is bounded for any image: 1 bit or more for 258 of them.
constexpr std::uint64_t kMaxZeros = std::uint64_t{1} << 22;

void put_block_head(BitWriter& out, const BlockHead& head) {
  for (std::uint32_t bit = 0; bit < head.bits; bit += 32) out.put(head.words[bit / 32], std::min(head.bits - bit, 32u));
}

/// Zeros that wait before row `r`, but for so many.
void put_zero_run(BitWriter& out, Chunks& chunks, FilteredRows& rows, std::uint32_t r, std::uint64_t max_left) {
  for (std::uint64_t zeros = rows.waiting(r); zeros > max_left; zeros = rows.waiting(r)) {
    zeros = std::min(zeros, kMaxZeros);
    chunks.ensure_capacity(out, FilteredRows::max_bytes_of_zeros(zeros));
    rows.put_zeros(out, zeros);
  }
}

}  // namespace

std::size_t put_image_data(RowRuns& image, std::uint64_t changes, Bytes& file, std::size_t start) {
  const std::uint32_t rows = image.rows();
  const Table& table = table_for(row_bytes(image.columns()) * rows, changes);
  Chunks chunks(file, start);
  BitWriter out(chunks.content());
  out.put(kZlibHeader, 16);
  put_block_head(out, table.head);

  FilteredRows filtered(table.codes, image.columns(), rows);
  std::span<const std::uint32_t> above;  // the row above the first one is white (9.2)
  for (std::uint32_t r = 0; r < rows; ++r) {
    const std::span<const std::uint32_t> row = image.row(r);
    if (row.empty()) {
      if (const RunsView* runs = image.runs()) r = g4::end_of_empty_rows(runs->row_offset, r) - 1;
    } else {
      put_zero_run(out, chunks, filtered, r, FilteredRows::kMaxWaiting);
      chunks.ensure_capacity(out, filtered.max_bytes(row.size() + above.size()));
      filtered.put(out, r, row, above);
    }
    above = row;
  }
  put_zero_run(out, chunks, filtered, rows, 0);
  chunks.ensure_capacity(out, 16);
  out.put(table.codes.end);
  return chunks.close(put_number(out.finish(), filtered.check()));
}

}  // namespace lamina::formats::png
