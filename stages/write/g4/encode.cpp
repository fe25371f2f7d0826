#include "stages/write/g4/encode.h"

#include <algorithm>
#include <cstring>
#include <span>
#include <utility>

#include "stages/write/g4/bit_writer.h"
#include "stages/write/g4/codes.h"

namespace lamina::write::g4 {
namespace {

// A scratch row is: one 0, the changes, and `columns` this many times. The 0 is read as the change before the first
// one; the tail stands for T.6's imaginary change after the last pixel and is as long as four changes read at once
// from beyond the last one need.
constexpr std::size_t kHead = 1;
constexpr std::size_t kTail = 8;

void copy_row(std::span<const std::uint32_t> row, std::uint32_t columns, Buffer<std::uint32_t>& scratch) {
  if (scratch.size() < kHead + row.size() + kTail) scratch.resize((kHead + row.size() + kTail) * 2);
  scratch[0] = 0;
  std::uint32_t* end = std::copy(row.begin(), row.end(), scratch.data() + kHead);
  std::fill_n(end, kTail, columns);
}

/// Vertical modes with shift 0 that say that a row is like the one above: one a change, the end of the row included.
std::uint64_t changes_to_code(std::span<const std::uint32_t> row, std::uint32_t columns) {
  return row.size() + (row.empty() || row.back() != columns ? 1 : 0);
}

/// No row takes more bytes: at most 53 bits for two changes, 4 bits for two changes above, 12 bits for 2560 columns.
std::size_t most_bytes(std::size_t changes, std::size_t changes_above, std::uint32_t columns) {
  return 4 * changes + changes_above + columns / 1024 + 64;
}

/// The row after `row` and all empty rows that follow it. Offsets never fall, so a search by doubling finds the end.
std::uint32_t end_of_empty_rows(std::span<const std::uint32_t> row_offset, std::uint32_t row) {
  const std::uint32_t offset = row_offset[row];
  const std::size_t last = row_offset.size() - 1;
  std::size_t known = row + 1, step = 1;
  while (known + step <= last && row_offset[known + step] == offset) {
    known += step;
    step *= 2;
  }
  const auto limit = row_offset.begin() + static_cast<std::ptrdiff_t>(std::min(known + step, last + 1));
  const auto past = std::upper_bound(row_offset.begin() + static_cast<std::ptrdiff_t>(known), limit, offset);
  return static_cast<std::uint32_t>(past - row_offset.begin() - 1);
}

struct RunWord {
  std::uint64_t bits;
  std::uint32_t length;
};

RunWord run_word(const RunCodes& codes, std::uint32_t run) {
  const Code make_up = codes.make_up[run >> 6], terminating = codes.terminating[run & 63];
  return {std::uint64_t{make_up.bits()} << terminating.length() | terminating.bits(), make_up.length() + terminating.length()};
}

void put_long_run(BitWriter& writer, const RunCodes& codes, std::uint32_t run) {
  for (; run >= kLongestMakeUp + 64; run -= kLongestMakeUp) writer.put(codes.make_up[kLongestMakeUp / 64]);
  const RunWord word = run_word(codes, run);
  writer.put(word.bits, word.length);
}

/// `first` in the colour `black`, then `second` in the other.
inline void put_horizontal(BitWriter& writer, unsigned black, std::uint32_t first, std::uint32_t second) {
  const RunCodes &codes = kRunCodes[black], &other = kRunCodes[black ^ 1];
  if ((first | second) < kLongestMakeUp) [[likely]] {
    const RunWord one = run_word(codes, first), two = run_word(other, second);
    const std::uint64_t bits = (std::uint64_t{kHorizontal.bits()} << one.length | one.bits) << two.length | two.bits;
    writer.put(bits, kHorizontal.length() + one.length + two.length);
  } else {
    writer.put(kHorizontal);
    put_long_run(writer, codes, first);
    put_long_run(writer, other, second);
  }
}

using FourInts [[gnu::vector_size(16)]] = std::int32_t;

FourInts four(const std::uint32_t* at) {
  FourInts value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

/// True, and the four words are written, if the next four changes are all coded by vertical modes and keep step with
/// the changes above. `b` is the change above that T.6 calls b1.
inline bool put_four_vertical(BitWriter& writer, const std::uint32_t* a, const std::uint32_t* b) {
  const FourInts change = four(a), above = four(b);
  const FourInts mode = change - above + 3;
  // The next b1 is the next change above unless that one is not beyond this change (then it is two further on, or
  // this change needs pass mode) or the one before is (then it is that one).
  const FourInts stops = (mode > 6) | (mode < 0) | (four(b + 1) <= change) | (four(b - 1) > change);
  std::uint64_t halves[2];
  std::memcpy(halves, &stops, sizeof halves);
  if ((halves[0] | halves[1]) != 0) return false;
  std::memcpy(halves, &mode, sizeof halves);
  if constexpr (std::endian::native == std::endian::big) {
    for (std::uint64_t& half : halves) half = half >> 32 | half << 32;
  }
  const std::uint64_t index = ((halves[0] | halves[0] >> 29) & 63) | ((halves[1] | halves[1] >> 29) & 63) << 6;
  writer.put(kFourVertical[index]);
  return true;
}

/// One row; `a` and `b` point to the first changes of the row and of the one above, in scratch rows.
/// Names as in T.6: a0 is where coding stands, a[0] is a1, b[0] is b1. a and b move in step, so that both are at
/// changes to black or both at changes to white.
void put_row(BitWriter& writer, const std::uint32_t* a, const std::uint32_t* b, std::uint32_t columns) {
  const std::uint32_t* const a_start = a;
  std::uint32_t a0 = 0;
  for (;;) {
    while (a[3] < columns && put_four_vertical(writer, a, b)) {
      a += 4;
      b += 4;
      a0 = a[-1];
    }
    // The way of all rows: it ends a row, and takes a few changes where four do not keep step.
    for (const std::uint32_t* const a_enough = a + 4; a < a_enough;) {
      const std::uint32_t a1 = *a;
      const std::uint32_t shift = a1 - *b + 3;
      if (b[1] < a1) {
        writer.put(kPass);
        a0 = b[1];
        b += 2;  // beyond a0, as changes above rise
        continue;
      }
      if (shift <= 6) {
        writer.put(kVertical[shift]);
        if (a1 == columns) return;
        ++a;
        b += b[-1] > a1 ? -1 : b[1] > a1 ? 1 : 3;
        a0 = a1;
        continue;
      }
      const std::uint32_t a2 = a[1];
      put_horizontal(writer, static_cast<unsigned>(a - a_start) & 1, a1 - a0, a2 - a1);
      if (a2 == columns) return;
      a += 2;
      a0 = a2;
      while (*b <= a0) b += 2;
    }
  }
}

}  // namespace

std::size_t Encoder::encode(const RunsView& runs, Buffer<std::byte>& file, std::size_t start) {
  const std::uint32_t columns = runs.columns, rows = runs.rows();
  if (file.size() < start + 64) file.resize(std::max(start + 64, file.capacity()));
  BitWriter writer(file.data() + start);
  const auto make_room = [&](std::size_t bytes) {
    const std::size_t used = static_cast<std::size_t>(writer.next() - file.data());
    if (file.size() - used >= bytes) return;
    file.resize(std::max(used + bytes, file.size() * 2));
    writer.move_to(file.data() + used);
  };

  std::span<const std::uint32_t> above;  // T.6: the row above the first one is white
  copy_row(above, columns, reference_);
  for (std::uint32_t r = 0; r < rows;) {
    const std::span<const std::uint32_t> row = runs.row(r);
    if (std::equal(row.begin(), row.end(), above.begin(), above.end())) {
      const std::uint32_t next = row.empty() ? end_of_empty_rows(runs.row_offset, r) : r + 1;
      const std::uint64_t ones = changes_to_code(row, columns) * (next - r);
      make_room(ones / 8 + 64);
      writer.put_ones(ones);
      r = next;
      continue;
    }
    make_room(most_bytes(row.size(), above.size(), columns));
    copy_row(row, columns, coding_);
    put_row(writer, coding_.data() + kHead, reference_.data() + kHead, columns);
    std::swap(coding_, reference_);
    above = row;
    ++r;
  }
  make_room(64);
  writer.put(kEndOfFacsimileBlock);
  return static_cast<std::size_t>(writer.finish() - file.data());
}

}  // namespace lamina::write::g4
