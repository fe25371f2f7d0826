// stages/support/text/decimal.h: whole numbers of a decimal fraction as text (nanometres as millimetres), exactly, fast,
// without locale.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/units.h"

namespace lamina {

/// Room that put_fixed() and put_mm() need at most: a sign, 20 digits, a point, and a little more.
inline constexpr std::size_t kMaxDecimal = 24;

/// "000102...99": the two digits of n begin at 2 n.
inline constexpr auto kDigitPairs = [] {
  std::array<char, 200> pairs{};
  for (std::size_t n = 0; n < 100; ++n) {
    pairs[2 * n] = static_cast<char>('0' + n / 10);
    pairs[2 * n + 1] = static_cast<char>('0' + n % 10);
  }
  return pairs;
}();

/// Writes the two digits of a number below 100. Returns the end.
inline char* put_pair(std::uint32_t value, char* out) {
  std::memcpy(out, &kDigitPairs[2 * value], 2);
  return out + 2;
}

/// Writes a whole number. Returns the end.
inline char* put_whole(std::uint64_t value, char* out) {
  if (value < 1000) {
    const auto small = static_cast<std::uint32_t>(value);
    if (small >= 100) *out++ = static_cast<char>('0' + small / 100);
    if (small >= 10) return put_pair(small % 100, out);
    *out = static_cast<char>('0' + small);
    return out + 1;
  }
  char digits[20];
  char* first = digits + sizeof digits;
  for (; value >= 100; value /= 100) put_pair(static_cast<std::uint32_t>(value % 100), first -= 2);
  if (value >= 10) {
    put_pair(static_cast<std::uint32_t>(value), first -= 2);
  } else {
    *--first = static_cast<char>('0' + value);
  }
  const auto count = static_cast<std::size_t>(digits + sizeof digits - first);
  std::memcpy(out, first, count);
  return out + count;
}

/// Writes `value` / 10^decimals without trailing zeros: 12500 with 3 decimals is "12.5", -5 is "-0.005", 0 is "0".
/// Returns the end. decimals 0 .. 6; at most 22 bytes are written
template <int kDecimals>
char* put_fixed(std::int64_t value, char* out) {
  const std::uint64_t size = value < 0 ? 0 - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
  if (value < 0) *out++ = '-';
  constexpr std::uint64_t kUnit[] = {1, 10, 100, 1000, 10'000, 100'000, 1'000'000};
  out = put_whole(size / kUnit[kDecimals], out);
  const auto rest = static_cast<std::uint32_t>(size % kUnit[kDecimals]);
  if (rest == 0) return out;
  *out++ = '.';
  std::uint32_t left = rest;
  for (int at = kDecimals; at > 0; left /= 100) {
    at -= 2;
    if (at >= 0) {
      put_pair(left % 100, out + at);
    } else {
      out[0] = static_cast<char>('0' + left);
    }
  }
  int used = kDecimals;
  while (out[used - 1] == '0') --used;
  return out + used;
}

/// Writes a length in mm with as many decimals as it has, at most 6: 12500000 is "12.5". Returns the end.
inline char* put_mm(std::int64_t nm, char* out) {
  static_assert(kNmPerMm == 1'000'000);
  return put_fixed<6>(nm, out);
}

inline void append(Buffer<char>& out, std::string_view text) { out.insert(out.end(), text.begin(), text.end()); }

inline void append_mm(Buffer<char>& out, std::int64_t nm) {
  char text[kMaxDecimal];
  append(out, {text, static_cast<std::size_t>(put_mm(nm, text) - text)});
}

/// Appends what `write(char*)`, which returns its end, writes into at most `most` bytes.
template <class Write>
void append_written(Buffer<char>& out, std::size_t maximum, Write&& write) {
  const std::size_t before = out.size();
  out.resize(before + maximum);
  char* const begin = out.data() + before;
  out.resize(before + static_cast<std::size_t>(write(begin) - begin));
}

}  // namespace lamina
