#include "stages/formats/g4/encode.h"

#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <utility>

#include "stages/formats/g4/steps.h"
#include "stages/geometry/isa.h"
#include "stages/geometry/targets.h"

namespace lamina::formats::g4 {
namespace {

// T.6's horizontal mode, two runs by their lengths.

struct RunWord {
  std::uint64_t bits;
  std::uint32_t length;
};

inline RunWord run_word(const RunCodes& codes, std::uint32_t run) {
  const Code make_up = codes.make_up[run >> 6], terminating = codes.terminating[run & 63];
  return {std::uint64_t{make_up.bits()} << terminating.length() | terminating.bits(), make_up.length() + terminating.length()};
}

/// The make-up code for 2560 `times` after each other, at most four of them.
constexpr RunWord longest_make_ups(std::uint32_t times) {
  constexpr Code kOne = kRunCodes[0].make_up[kLongestMakeUp / 64];  // of both colours
  std::uint64_t four = 0;
  for (int i = 0; i < 4; ++i) four = four << kOne.length() | kOne.bits();
  return {four & ((std::uint64_t{1} << times * kOne.length()) - 1), times * kOne.length()};
}

inline void put_run(BitWriter& writer, const RunCodes& codes, std::uint32_t run) {
  if (run >= kLongestMakeUp + 64) {
    std::uint32_t times = (run - 64) / kLongestMakeUp;  // leaves 64 .. 2623
    run -= times * kLongestMakeUp;
    for (; times > 4; times -= 4) writer.put(longest_make_ups(4).bits, longest_make_ups(4).length);
    const RunWord make_ups = longest_make_ups(times);
    writer.put(make_ups.bits, make_ups.length);
  }
  const RunWord word = run_word(codes, run);
  writer.put(word.bits, word.length);
}

/// `first` in the colour `black`, then `second` in the other.
inline void put_horizontal(BitWriter& writer, unsigned black, std::uint32_t first, std::uint32_t second) {
  const RunCodes &codes = kRunCodes[black], &other = kRunCodes[black ^ 1];
  if ((first | second) < 64) [[likely]] {
    const Code one = codes.terminating[first], two = other.terminating[second];
    const std::uint64_t bits = (std::uint64_t{kHorizontal.bits()} << one.length() | one.bits()) << two.length() | two.bits();
    writer.put(bits, kHorizontal.length() + one.length() + two.length());
  } else if ((first | second) < kLongestMakeUp) {
    const RunWord one = run_word(codes, first), two = run_word(other, second);
    const std::uint64_t bits = (std::uint64_t{kHorizontal.bits()} << one.length | one.bits) << two.length | two.bits;
    writer.put(bits, kHorizontal.length() + one.length + two.length);
  } else {
    writer.put(kHorizontal);
    put_run(writer, codes, first);
    put_run(writer, other, second);
  }
}

// A scratch row is: one 0, the changes, and `columns` this many times. The 0 is read as the change before the first
// one; the tail stands for T.6's imaginary change after the last pixel and is as long as eight changes read at once
// from beyond the last one need.
constexpr std::size_t kHead = 1;
constexpr std::size_t kTail = 12;

void copy_row(std::span<const std::uint32_t> row, std::uint32_t columns, Buffer<std::uint32_t>& scratch) {
  if (scratch.size() < kHead + row.size() + kTail) scratch.resize((kHead + row.size() + kTail) * 2);
  scratch[0] = 0;
  std::uint32_t* end = std::copy(row.begin(), row.end(), scratch.data() + kHead);
  std::fill_n(end, kTail, columns);
}

/// Rows that differ mostly do in their first change or their last.
bool is_same(std::span<const std::uint32_t> a, std::span<const std::uint32_t> b) {
  if (a.size() != b.size()) return false;
  return a.empty() || (a.front() == b.front() && a.back() == b.back() && std::equal(a.begin(), a.end(), b.begin()));
}

/// Vertical modes with shift 0 that say that a row is like the one above: one a change, the end of the row included.
std::uint64_t changes_to_code(std::span<const std::uint32_t> row, std::uint32_t columns) {
  return row.size() + (row.empty() || row.back() != columns ? 1 : 0);
}

/// No row takes more bytes: at most 53 bits for two changes, 4 bits for two changes above, 12 bits for 2560 columns.
std::size_t max_bytes(std::size_t changes, std::size_t changes_above, std::uint32_t columns) {
  return 4 * changes + changes_above + columns / 1024 + 64;
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

#if defined(__SSE2__)
/// Writes the words of the next eight changes if they are all coded by vertical modes and keep step with the changes above, as
/// put_four_vertical() has it, or of the next four. returns  how many it wrote: 8, 4 or 0
inline std::uint32_t put_eight_vertical(BitWriter& writer, const std::uint32_t* a, const std::uint32_t* b) {
  const auto load = [](const std::uint32_t* at) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(at)); };
  const __m128i low = load(a), high = load(a + 4);
  const __m128i shift = _mm_packs_epi32(_mm_sub_epi32(low, load(b)), _mm_sub_epi32(high, load(b + 4)));  // far off stays far
  const __m128i mode = _mm_add_epi16(shift, _mm_set1_epi16(3));
  const __m128i keeps_low = _mm_andnot_si128(_mm_cmpgt_epi32(load(b - 1), low), _mm_cmpgt_epi32(load(b + 1), low));
  const __m128i keeps_high = _mm_andnot_si128(_mm_cmpgt_epi32(load(b + 3), high), _mm_cmpgt_epi32(load(b + 5), high));
  const __m128i in_reach = _mm_cmpeq_epi16(_mm_subs_epu16(mode, _mm_set1_epi16(6)), _mm_setzero_si128());
  const int good = _mm_movemask_epi8(_mm_and_si128(in_reach, _mm_packs_epi32(keeps_low, keeps_high)));
  const __m128i part = _mm_madd_epi16(mode, _mm_set_epi16(512, 64, 8, 1, 512, 64, 8, 1));
  const auto first = static_cast<std::uint64_t>(_mm_cvtsi128_si64(part));
  const auto last = static_cast<std::uint64_t>(_mm_cvtsi128_si64(_mm_unpackhi_epi64(part, part)));
  if (good != 0xFFFF) {
    if ((good & 0xFF) != 0xFF) return 0;
    writer.put(kFourVertical[static_cast<std::uint32_t>(first + (first >> 32))]);
    return 4;
  }
  const Code one = kFourVertical[static_cast<std::uint32_t>(first + (first >> 32))];
  const Code two = kFourVertical[static_cast<std::uint32_t>(last + (last >> 32))];
  writer.put(std::uint64_t{one.bits()} << two.length() | two.bits(), one.length() + two.length());
  return 8;
}
#endif

/// Writes the words of the next changes as long as they keep step, by eights and fours, but not of the last one of the row.
/// returns  how many they are
inline std::uint32_t put_in_step(BitWriter& writer, const std::uint32_t* a, const std::uint32_t* b, std::uint32_t columns) {
  std::uint32_t done = 0;
#if defined(__SSE2__)
  while (a[done + 7] < columns) {
    const std::uint32_t more = put_eight_vertical(writer, a + done, b + done);
    if (more != 8) return done + more;
    done += 8;
  }
#endif
  while (a[done + 3] < columns && put_four_vertical(writer, a + done, b + done)) done += 4;
  return done;
}

/// Changes that take the general path between two tests whether eight keep step: minimum, and after failed tests.
constexpr std::uint32_t kMinBetween = 4, kMaxBetween = 64;
constexpr std::array<Code, 8> kVerticalOrPass = {kVertical[0], kVertical[1], kVertical[2], kVertical[3],
                                                 kVertical[4], kVertical[5], kVertical[6], kPass};

/// One row from its change number `done` on; `a` and `b` point to the first changes of the row and of the one above, in scratch
/// rows. Those before are coded, and b[done] is b1 then.
/// Names as in T.6: a0 is where coding stands, a[0] is a1, b[0] is b1. a and b move in step, so that both are at
/// changes to black or both at changes to white.
/// The writer is a value: what it writes are bytes, which might be its own if anybody had its address.
BitWriter put_row(BitWriter writer, const std::uint32_t* a, const std::uint32_t* b, std::uint32_t done, std::uint32_t columns) {
  const std::uint32_t* const a_start = a;
  a += done;
  b += done;
  std::uint32_t a0 = a[-1], between = kMinBetween;
  for (;;) {
    const std::uint32_t in_step = put_in_step(writer, a, b, columns);
    a += in_step;
    b += in_step;
    if (in_step != 0) a0 = a[-1];
    between = in_step >= 8 ? kMinBetween : std::min(2 * between, kMaxBetween);
    // The way of all rows: it ends a row, and takes a few changes where four do not keep step. Whether one is passed over or
    // coded, and which is the next b1, is chosen without a branch: rows of dithered images are too irregular to foresee it.
    for (const std::uint32_t* const a_enough = a + between; a < a_enough;) {
      const std::uint32_t a1 = *a, b2 = b[1], shift = a1 - *b + 3;
      std::uint32_t passes = b2 < a1 ? 1 : 0;
#if defined(__GNUC__)
      asm("" : "+r"(passes));  // or compilers branch on it again
#endif
      if ((shift > 6) > passes) {
        const std::uint32_t a2 = a[1];
        put_horizontal(writer, static_cast<unsigned>(a - a_start) & 1, a1 - a0, a2 - a1);
        if (a2 == columns) return writer;
        a += 2;
        a0 = a2;
        while (*b <= a0) b += 2;
        continue;
      }
      writer.put(kVerticalOrPass[(shift | (0 - passes)) & 7]);
      if (a1 == columns && passes == 0) return writer;
      // The next b1: beyond a0, as changes above rise. It is the next change, or if the one before lies beyond a1 that one, or
      // if the next does not the third; two on after a pass.
      const int beyond = (b[-1] > a1 ? 1 : 0) + (b2 > a1 ? 1 : 0);
      b += 3 - 2 * beyond - static_cast<int>(passes);
      a += 1 - passes;
      a0 = std::min(a1, b2);
    }
  }
}

/// Rows of so many changes at most are tried without a copy.
constexpr std::uint32_t kFewChanges = 8;
constexpr std::uint32_t kRowsAtOnce = 64;
constexpr std::size_t kFewRowsBytes = kRowsAtOnce * 16 + 16;  // vertical modes of 7 bits, and a last store

/// One row of `changes` at `a`, those of the row above before them. True, and the row is written, if each change follows
/// the one above it by a vertical mode. Where changes above are more than 3 columns apart, one that is at most 3 from its
/// own comes before the next one and behind the one before, so that T.6's b1 is always the change of the same number;
/// where any are nearer, the row takes the way of all rows.
inline bool put_few_changes(BitWriter& writer, const std::uint32_t* a, std::uint32_t changes, std::uint32_t columns) {
  const std::uint32_t* b = a - changes;
  const std::uint32_t* const last = a - 2;  // two of the row above
  BitWriter trial = writer;
  std::uint64_t bits = 0;
  std::uint32_t length = 0;
  unsigned stops = 0;
  for (;; a += 2, b += 2) {
    const std::uint32_t mode = a[0] - b[0] + 3, next_mode = a[1] - b[1] + 3;
    const std::uint32_t beyond = b == last ? columns : b[2];
    stops |= unsigned{mode > 6} | unsigned{next_mode > 6} | unsigned{b[1] - b[0] <= 3} | unsigned{beyond - b[1] <= 3};
    const Code code = two_vertical(mode & 7, next_mode & 7);
    bits = bits << code.length() | code.bits();
    length += code.length();
    if (b == last) break;
    if (length <= 40) continue;
    trial.put(bits, length);
    bits = 0;
    length = 0;
  }
  if ((stops | unsigned{a[1] == columns}) != 0) return false;
  trial.put(bits << 1 | 1, length + 1);  // the end of the row, as above
  writer = trial;
  return true;
}

/// Rows from `r` on, straight from the runs, as long as they are of few changes and follow those above: nearly all rows of
/// parts with few edges. Changes of all rows lie behind each other, so that a pointer into them is all that moves on.
/// needs    a row above and kFewRowsBytes of room
/// returns  the first row that is not written, r + kRowsAtOnce at most
std::uint32_t put_few_rows(BitWriter& writer, const RunsView& runs, std::uint32_t r) {
  const std::uint32_t* const offset = runs.row_offset.data();
  const std::uint32_t changes = offset[r] - offset[r - 1];
  const std::uint32_t end = std::min(runs.rows(), r + kRowsAtOnce);
  BitWriter out = writer;
  const std::uint32_t* row = runs.change.data() + offset[r];
  for (; r < end && offset[r + 1] - offset[r] == changes; ++r, row += changes) {
    if (!(changes == 2 ? put_few_changes(out, row, 2, runs.columns) : put_few_changes(out, row, changes, runs.columns))) break;
  }
  writer = out;
  return r;
}

// Rows that have as many changes as those above them, many changes at a time.

/// The body for an instruction set that this processor has (geometry/isa.h), not kAuto; nullptr: none is faster than coding
/// row by row.
const StepsBody* steps_body([[maybe_unused]] Isa isa) {
#if defined(LAMINA_WIDE_KERNELS)
  static constexpr StepsBody kAvx2{8, avx2::put_steps}, kAvx512{16, avx512::put_steps};
  if (isa == Isa::kAvx512) return &kAvx512;
  if (isa == Isa::kAvx2) return &kAvx2;
#endif
  return nullptr;
}

/// From change `at` of a task on, those that take horizontal mode: a far one, and with it the next of its row.
/// returns  the first that does not, or that is the last of `count` and not of its row
std::uint32_t put_horizontals(BitWriter& writer, const StepsTask& task, const Steps& steps, std::uint32_t at,
                              std::uint32_t count) {
  const std::uint32_t usable = steps.keeps & steps.far, ends = task.ends.bits();
  while (at < count && (usable >> at & 1) != 0) {
    const std::uint32_t* const change = task.change + at;
    const bool first = at == 0 ? task.ends.position() == 0 : (ends >> (at - 1) & 1) != 0;
    const std::uint32_t before = first ? 0 : change[-1];
    if ((ends >> at & 1) != 0) {  // the other run reaches the end of the row; rows have pairs of changes, so it is white
      put_horizontal(writer, 1, change[0] - before, task.columns - change[0]);
      at += 1;
      continue;
    }
    if ((steps.keeps >> (at + 1) & 1) == 0) break;
    put_horizontal(writer, (task.ends.position() + at) & 1, change[0] - before, change[1] - change[0]);
    if ((ends >> (at + 1) & 1) != 0) writer.put(kVertical[3]);
    at += 2;
  }
  return at;
}

/// Rows that follow each other; the first has a row above, and all have the same number of changes.
struct SteadyRows {
  const std::uint32_t* change;  // the first of the first row
  std::uint32_t changes;        // of a row, 2 or more
  std::uint32_t rows;
  std::uint32_t columns;
};

/// Codes changes from the first on as long as none needs pass mode. needs  room for all of them
/// returns  how many are coded; each row whose last change is among them is whole. The first that is not coded has the change
///          above of the same number as T.6's b1, the one before it as a0
std::uint32_t put_steady_rows(BitWriter& writer, const SteadyRows& rows, const StepsBody& body) {
  const std::uint32_t total = rows.changes * rows.rows;
  BitWriter out = writer;
  StepsTask task{rows.change, total, rows.changes, rows.columns, RowEnds(rows.changes, body.lanes)};
  Steps steps;
  for (;;) {
    body.put(out, task, steps);
    if (task.left == 0) break;
    const std::uint32_t count = std::min(body.lanes, task.left);
    std::uint32_t at = steps.count;
    if (at != 0) put_words(out, steps);
    if (at < count) at = put_horizontals(out, task, steps, at, count);
    task.left -= at;
    // A change that keeps no step stops, and so does a far one before such.
    const bool stops = at < count && (steps.keeps >> at & 1) == 0;
    const bool before_stop = at + 1 < count && (steps.keeps >> at & steps.far >> at & 1) != 0;
    if (stops || before_stop || task.left == 0) break;
    task.change += at;
    task.ends.advance(at);
  }
  writer = out;
  return total - task.left;
}

/// Rows from `r` on that have as many changes as that one, as many as need little room.
SteadyRows steady_rows(const RunsView& runs, std::uint32_t r) {
  constexpr std::size_t kCapacity = 8192;
  const std::uint32_t* const offset = runs.row_offset.data();
  const std::uint32_t changes = offset[r + 1] - offset[r];
  const auto maximum =
      static_cast<std::uint32_t>(std::min<std::size_t>(kCapacity / max_bytes(changes, changes, runs.columns), runs.rows() - r));
  std::uint32_t end = r + 1;
  while (end < r + maximum && offset[end + 1] - offset[end] == changes) ++end;
  return {runs.change.data() + offset[r], changes, end - r, runs.columns};
}

BitWriter start_file(Buffer<std::byte>& file, std::size_t start) {
  if (file.size() < start + 64) file.resize(std::max(start + 64, file.capacity()));
  return BitWriter(file.data() + start);
}

/// Makes the file large enough for so many bytes more.
void reserve_bytes(BitWriter& writer, Buffer<std::byte>& file, std::size_t bytes) {
  const std::size_t used = static_cast<std::size_t>(writer.next() - file.data());
  if (file.size() - used >= bytes) return;
  file.resize(used + bytes);
  writer.move_to(file.data() + used);
}

}  // namespace

Encoder::Encoder(Isa isa) : body_(steps_body(limited_isa(isa))) {}

std::size_t Encoder::encode(const RunsView& runs, Buffer<std::byte>& file, std::size_t start) {
  BitWriter writer = put_rows(start_file(file, start), runs, 0, file);
  reserve_bytes(writer, file, 64);
  writer.put(kEndOfFacsimileBlock);
  return static_cast<std::size_t>(writer.finish() - file.data());
}

std::size_t Encoder::encode(const BitRows& rows, Buffer<std::byte>& file, std::size_t start) {
  constexpr std::size_t kChangesAtOnce = 1 << 16;
  constexpr std::uint32_t kMaxRows = 4096;
  BitWriter writer = start_file(file, start);
  RowRuns image(rows);
  Runs some;  // with the row above them
  some.columns = image.columns();
  const auto add = [&](std::uint32_t r) {
    const std::span<const std::uint32_t> row = image.row(r);
    some.change.insert(some.change.end(), row.begin(), row.end());
    some.row_offset.push_back(static_cast<std::uint32_t>(some.change.size()));
  };
  for (std::uint32_t r = 0; r < image.rows();) {
    const std::uint32_t first = r;
    some.change.clear();
    some.row_offset.assign(1, 0);
    if (first > 0) add(first - 1);
    for (; r < image.rows() && r < first + kMaxRows && some.change.size() < kChangesAtOnce; ++r) add(r);
    writer = put_rows(writer, some, first > 0 ? 1 : 0, file);
    // As much as the rest takes, so that a large file is not held twice while it grows.
    const auto used = static_cast<std::size_t>(writer.next() - file.data());
    const auto expected = static_cast<std::size_t>(1.05 * static_cast<double>(used) / r * image.rows());
    if (file.size() < expected) reserve_bytes(writer, file, std::max(expected, file.size() / 4 * 5) - used);
  }
  reserve_bytes(writer, file, 64);
  writer.put(kEndOfFacsimileBlock);
  return static_cast<std::size_t>(writer.finish() - file.data());
}

/// Rows of an image from `first` on, 0 or 1; row 0 is the one above then.
BitWriter Encoder::put_rows(BitWriter writer, const RunsView& runs, std::uint32_t first, Buffer<std::byte>& file) {
  const std::uint32_t columns = runs.columns, rows = runs.rows();
  const auto ensure_capacity = [&](std::size_t bytes) {
    const std::size_t used = static_cast<std::size_t>(writer.next() - file.data());
    if (file.size() - used < bytes) reserve_bytes(writer, file, std::max(bytes, file.size() * 2 - used));
  };

  std::span<const std::uint32_t> above;  // T.6: the row above the first one is white
  if (first > 0) above = runs.row(0);
  copy_row(above, columns, reference_);
  bool copied = true;  // reference_ holds `above`
  for (std::uint32_t r = first; r < rows;) {
    std::span<const std::uint32_t> row = runs.row(r);
    std::uint32_t coded = 0;  // changes of the row
    const bool same = row.size() > kFewChanges && is_same(row, above);
    if (body_ != nullptr && row.size() == above.size() && !row.empty() && !same) {
      const SteadyRows steady = steady_rows(runs, r);
      ensure_capacity(steady.rows * max_bytes(row.size(), row.size(), columns));
      const std::uint32_t done = put_steady_rows(writer, steady, *body_);
      const std::uint32_t whole = done / steady.changes;
      coded = done - whole * steady.changes;
      if (whole != 0) {
        copied = false;
        r += whole;
        above = runs.row(r - 1);
        if (whole == steady.rows) continue;
        row = runs.row(r);
      }
    } else if (row.size() == above.size() && row.size() - 1 < kFewChanges) {
      ensure_capacity(kFewRowsBytes);
      const std::uint32_t next = put_few_rows(writer, runs, r);
      if (next != r) {
        copied = false;
        above = runs.row(next - 1);
        r = next;
        continue;
      }
    }
    if (coded == 0 && (same || is_same(row, above))) {
      const std::uint32_t next = row.empty() ? end_of_empty_rows(runs.row_offset, r) : r + 1;
      const std::uint64_t ones = changes_to_code(row, columns) * (next - r);
      ensure_capacity(ones / 8 + 64);
      writer.put_ones(ones);
      r = next;
      continue;
    }
    ensure_capacity(max_bytes(row.size(), above.size(), columns));
    if (!copied) copy_row(above, columns, reference_);
    copied = true;
    copy_row(row, columns, coding_);
    writer = put_row(writer, coding_.data() + kHead, reference_.data() + kHead, coded, columns);
    std::swap(coding_, reference_);
    above = row;
    ++r;
  }
  return writer;
}

}  // namespace lamina::formats::g4
