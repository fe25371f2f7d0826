// stages/write/decimal.h: nanometres as millimetres in text, exactly and fast.
#pragma once

#include <cstdint>
#include <cstring>
#include <string_view>

#include "stages/data/buffer.h"
#include "stages/data/units.h"

namespace lamina::write {

/// Room that put_mm() needs at most: a sign, 13 digits, a point, 6 digits.
inline constexpr std::size_t kMostDecimal = 24;

/// Writes a length in mm with as many decimals as it has, at most 6: 12500000 is "12.5". Returns the end.
inline char* put_mm(std::int64_t nm, char* out) {
  std::uint64_t value = nm < 0 ? 0 - static_cast<std::uint64_t>(nm) : static_cast<std::uint64_t>(nm);
  if (nm < 0) *out++ = '-';
  std::uint64_t whole = value / kNmPerMm;
  auto rest = static_cast<std::uint32_t>(value % kNmPerMm);
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
  char decimals[6];
  for (int i = 5; i >= 0; --i) {
    decimals[i] = static_cast<char>('0' + rest % 10);
    rest /= 10;
  }
  std::size_t used = 6;
  while (decimals[used - 1] == '0') --used;
  std::memcpy(out, decimals, 6);  // room for all six is asked for
  return out + used;
}

inline void append(Buffer<char>& out, std::string_view text) { out.insert(out.end(), text.begin(), text.end()); }

inline void append_mm(Buffer<char>& out, std::int64_t nm) {
  char text[kMostDecimal];
  append(out, {text, static_cast<std::size_t>(put_mm(nm, text) - text)});
}

/// Appends what `write(char*)`, which returns its end, writes into at most `most` bytes.
template <class Write>
void append_written(Buffer<char>& out, std::size_t most, Write&& write) {
  const std::size_t before = out.size();
  out.resize(before + most);
  char* const begin = out.data() + before;
  out.resize(before + static_cast<std::size_t>(write(begin) - begin));
}

}  // namespace lamina::write
