// stages/write/gcode/number.h: numbers of a G-code line: fixed decimals, trailing zeros left out, no locale.
#pragma once

#include <cstdint>
#include <cstring>

namespace lamina::write::gcode {

/// Writes `value` / 10^decimals: 12500 with 3 decimals is "12.5", -5 is "-0.005", 0 is "0". Returns the end; needs at
/// most 22 bytes. decimals 0 .. 6.
template <int kDecimals>
char* put_fixed(std::int64_t value, char* out) {
  std::uint64_t rest = value < 0 ? 0 - static_cast<std::uint64_t>(value) : static_cast<std::uint64_t>(value);
  if (value < 0) *out++ = '-';
  constexpr std::uint64_t kUnit[] = {1, 10, 100, 1000, 10'000, 100'000, 1'000'000};
  std::uint64_t whole = rest / kUnit[kDecimals];
  rest %= kUnit[kDecimals];
  char digits[20];
  char* first = digits + sizeof digits;
  do {
    *--first = static_cast<char>('0' + whole % 10);
    whole /= 10;
  } while (whole != 0);
  const auto count = static_cast<std::size_t>(digits + sizeof digits - first);
  std::memcpy(out, first, count);
  out += count;
  if (rest == 0) return out;
  *out++ = '.';
  int used = kDecimals;
  for (int i = kDecimals - 1; i >= 0; --i) {
    out[i] = static_cast<char>('0' + rest % 10);
    rest /= 10;
  }
  while (out[used - 1] == '0') --used;
  return out + used;
}

}  // namespace lamina::write::gcode
