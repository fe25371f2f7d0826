#include "stages/formats/g4/decode.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <utility>

#include "stages/geometry/t6_codes.h"

namespace lamina::formats {
namespace {

/// What the highest bits of a window say: of a mode 0 .. 6 (a1 - b1 + 3), kPassMode or kHorizontalMode; of a run its length.
struct WindowCode {
  std::uint16_t value = 0;
  std::uint8_t length = 0;  // bits; 0: no word begins so
  bool ends = false;        // a terminating code: no more follow
};

constexpr std::uint16_t kPassMode = 7, kHorizontalMode = 8;
constexpr std::uint32_t kModeBits = 7, kRunBits = 13;

template <std::size_t kSize>
constexpr void put(std::array<WindowCode, kSize>& table, std::uint32_t bits, t6::Code code, WindowCode word) {
  word.length = static_cast<std::uint8_t>(code.length());
  const std::uint32_t free = bits - code.length();
  for (std::uint32_t i = 0; i < 1u << free; ++i) table[(code.bits() << free) + i] = word;
}

constexpr std::array<WindowCode, 1 << kModeBits> kModes = [] {
  std::array<WindowCode, 1 << kModeBits> table{};
  for (std::uint16_t i = 0; i < 7; ++i) put(table, kModeBits, t6::kVertical[i], {i});
  put(table, kModeBits, t6::kPass, {kPassMode});
  put(table, kModeBits, t6::kHorizontal, {kHorizontalMode});
  return table;
}();

/// Vertical modes after each other that the highest bits of a window begin with: steps of a1 from b1.
struct Steps {
  std::uint8_t count = 0;
  std::array<std::int8_t, 7> step{};
};

constexpr std::uint32_t kStepsBits = 10;
constexpr std::array<std::uint8_t, 4> kStepLength{1, 3, 6, 7};  // bits, of none to three columns to a side

constexpr std::array<Steps, 1 << kStepsBits> kSteps = [] {
  std::array<Steps, 1 << kStepsBits> table{};
  for (std::uint32_t bits = 0; bits < table.size(); ++bits) {
    Steps& steps = table[bits];
    for (std::uint32_t at = 0; steps.count < steps.step.size();) {
      const std::uint32_t left = bits << at & (table.size() - 1);
      const WindowCode mode = kModes[left >> (kStepsBits - kModeBits)];
      at += mode.length;
      if (mode.length == 0 || mode.value >= kPassMode || at > kStepsBits) break;
      steps.step[steps.count++] = static_cast<std::int8_t>(mode.value - 3);
    }
  }
  return table;
}();

std::array<WindowCode, 1 << kRunBits> run_table(const t6::RunCodes& codes) {
  std::array<WindowCode, 1 << kRunBits> table{};
  for (std::uint16_t i = 0; i < codes.terminating.size(); ++i) {
    put(table, kRunBits, codes.terminating[i], {i, 0, true});
  }
  for (std::uint16_t i = 1; i < codes.make_up.size(); ++i) {
    put(table, kRunBits, codes.make_up[i], {static_cast<std::uint16_t>(64 * i), 0, false});
  }
  return table;
}

const std::array<WindowCode, 1 << kRunBits>& run_words(std::uint32_t black) {
  static const std::array tables{run_table(t6::kRunCodes[0]), run_table(t6::kRunCodes[1])};
  return tables[black];
}

/// At least 57 bits from bit `at` on, the first one highest. 8 bytes from there on must be readable.
std::uint64_t window(const std::byte* coded, std::uint64_t at) {
  std::uint64_t word;
  std::memcpy(&word, coded + at / 8, sizeof word);
  if constexpr (std::endian::native == std::endian::little) word = __builtin_bswap64(word);
  return word << at % 8;
}

/// Moves `at` behind a run's words; more than `most` if the run is longer or is none.
std::uint32_t take_run(const std::byte* coded, std::uint64_t& at, std::uint64_t end, std::uint32_t black,
                       std::uint32_t maximum) {
  const auto& words = run_words(black);
  std::uint32_t length = 0;
  for (;;) {
    const WindowCode word = words[window(coded, at) >> (64 - kRunBits)];
    at += word.length;
    if (word.length == 0 || at > end) return maximum + 1;
    length += word.value;
    if (length > maximum || word.ends) return length;
  }
}

constexpr std::uint32_t kBehind = 4;  // entries of `columns` behind a row

}  // namespace

/// From above_ into row_. All along, `b` is that of the first change above which lies behind a0 and leads to the other colour:
/// T.6's b1. As many changes as the row has so far, modulo 2, is the colour.
bool G4Decoder::decode_row(const std::byte* coded) {
  const std::uint32_t* const above = above_.data();
  std::uint32_t* const row = row_.data();
  const std::int64_t columns = columns_;
  std::uint64_t at = bit_;
  std::int64_t a0 = -1;
  std::uint32_t b = 0, n = 0;
  for (;;) {
    if (at > bits_) return false;
    const std::uint64_t bits = window(coded, at);
    if (bits >> 57 != 0x7F) {  // a slope: vertical modes that end before the last column
      const Steps& steps = kSteps[bits >> (64 - kStepsBits)];
      std::uint32_t k = 0;
      for (; k < steps.count; ++k) {
        const std::int64_t step = steps.step[k], a1 = std::int64_t{above[b]} + step;
        if (a1 <= a0 || a1 >= columns) break;
        row[n++] = static_cast<std::uint32_t>(a1);
        a0 = a1;
        at += kStepLength[static_cast<std::size_t>(step < 0 ? -step : step)];
        if (step < 0 && b > 0 && above[b - 1] > a1) {
          --b;
        } else {
          ++b;
          while (above[b] <= a1) b += 2;
        }
      }
      if (k > 0) continue;
    }
    if (bits >> 63 != 0) {  // vertical modes without a step, as many as there are
      const auto ones = std::min<std::uint32_t>(static_cast<std::uint32_t>(std::countl_one(bits)), 57);
      const std::uint32_t left = of_above_ > b ? of_above_ - b : 0, taken = std::min(ones, left);
      std::memcpy(row + n, above + b, taken * sizeof(std::uint32_t));
      n += taken, b += taken, at += taken;
      if (ones > left) {
        ++at;
        break;
      }
      a0 = row[n - 1];
      continue;
    }
    const WindowCode mode = kModes[bits >> (64 - kModeBits)];
    if (mode.length == 0) return false;
    at += mode.length;
    if (mode.value < kPassMode) {
      const std::int64_t a1 = std::int64_t{above[b]} + mode.value - 3;
      if (a1 <= a0 || a1 > columns) return false;
      if (a1 == columns) break;
      row[n++] = static_cast<std::uint32_t>(a1);
      a0 = a1;
      b = mode.value < 3 && b > 0 ? b - 1 : b + 1;
    } else if (mode.value == kPassMode) {
      if (above[b + 1] >= columns) return false;
      a0 = above[b + 1];
      b += 2;
    } else {
      const std::int64_t from = std::max<std::int64_t>(a0, 0);
      const std::uint32_t black = n & 1;
      const std::int64_t a1 = from + take_run(coded, at, bits_, black, static_cast<std::uint32_t>(columns - from));
      if (a1 > columns || (n > 0 && a1 <= row[n - 1])) return false;
      const std::int64_t a2 = a1 + take_run(coded, at, bits_, black ^ 1, static_cast<std::uint32_t>(columns - a1));
      if (a2 > columns || (a2 == a1 && a1 < columns)) return false;
      if (a1 < columns) row[n++] = static_cast<std::uint32_t>(a1);
      if (a2 == columns) break;
      row[n++] = static_cast<std::uint32_t>(a2);
      a0 = a2;
    }
    while (above[b] <= a0) b += 2;
  }
  changes_ = n;
  bit_ = at;
  return at <= bits_;
}

/// From row `r` of the strip on, until the runs have too many changes; `r` becomes the next one.
bool G4Decoder::decode_rows(const std::byte* coded, const G4Strip& strip, std::uint32_t& r, Runs& runs,
                            std::size_t max_changes) {
  for (; r < strip.rows && runs.change.size() < max_changes; ++r) {
    if (of_above_ == 0 && !strip.white_is_set) {  // a bit for each blank row below a blank one
      const std::uint64_t bits = window(coded, bit_);
      const std::uint32_t blank = std::min({static_cast<std::uint32_t>(std::countl_one(bits)), 57u, strip.rows - r});
      if (blank > 0) {
        bit_ += blank;
        if (bit_ > bits_) return false;
        runs.row_offset.insert(runs.row_offset.end(), blank, runs.row_offset.back());
        r += blank - 1;
        continue;
      }
    }
    if (!decode_row(coded)) return false;
    const std::size_t used = runs.change.size();
    if (used + changes_ + 2 > UINT32_MAX) return false;
    std::fill_n(row_.data() + changes_, kBehind, columns_);
    const bool begins_set = changes_ > 0 && row_[0] == 0;
    std::uint32_t skipped = 0;
    if (strip.white_is_set && begins_set) skipped = 1;
    if (strip.white_is_set && !begins_set) runs.change.push_back(0);
    runs.change.insert(runs.change.end(), row_.data() + skipped, row_.data() + changes_);
    if (runs.change.size() % 2 != 0) runs.change.push_back(columns_);
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
    std::swap(above_, row_);
    of_above_ = changes_;
  }
  return true;
}

void G4Decoder::start(Buffer<std::byte>& coded, const G4Strip& strip) {
  constexpr std::size_t kRead = 16;
  bits_ = std::uint64_t{coded.size()} * 8;
  bit_ = 0;
  coded.resize(coded.size() + kRead);
  std::memset(coded.data() + coded.size() - kRead, 0, kRead);
  if (strip.low_bit_first) {
    for (std::byte& byte : coded) {
      auto b = std::to_integer<unsigned>(byte);
      b = (b & 0xF0) >> 4 | (b & 0x0F) << 4;
      b = (b & 0xCC) >> 2 | (b & 0x33) << 2;
      byte = static_cast<std::byte>((b & 0xAA) >> 1 | (b & 0x55) << 1);
    }
  }
  columns_ = strip.columns;
  of_above_ = 0;
  above_.resize(std::size_t{columns_} + kBehind);
  row_.resize(std::size_t{columns_} + kBehind);
  std::fill_n(above_.data(), kBehind, columns_);
}

bool G4Decoder::append(Buffer<std::byte>& coded, const G4Strip& strip, Runs& runs) {
  start(coded, strip);
  std::uint32_t row = 0;
  return decode_rows(coded.data(), strip, row, runs, SIZE_MAX);
}

bool G4Decoder::append(Buffer<std::byte>& coded, const G4Strip& strip, RunsBuilder& builder) {
  constexpr std::size_t kChangesAtOnce = 1 << 18;
  start(coded, strip);
  Runs some;
  some.columns = strip.columns;
  for (std::uint32_t row = 0; row < strip.rows;) {
    some.row_offset.assign(1, 0);
    some.change.clear();
    if (!decode_rows(coded.data(), strip, row, some, kChangesAtOnce) || !builder.add_all(some)) return false;
  }
  return true;
}

}  // namespace lamina::formats
