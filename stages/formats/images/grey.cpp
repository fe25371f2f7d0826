// Rows of grey values become bits or levels.
#include <algorithm>
#include <cstring>

#include "stages/formats/images/image_formats.h"

namespace lamina::read {

void bits_of_grey(std::span<std::byte> row, std::uint32_t columns, std::size_t step, bool second, int threshold) {
  const std::size_t offset = second ? 1 : 0;
  for (std::uint32_t first = 0; first < columns; first += 8) {
    unsigned bits = 0;
    for (std::uint32_t i = 0; i < 8 && first + i < columns; ++i) {
      const int value = std::to_integer<int>(row[(std::size_t{first} + i) * step + offset]);
      bits |= static_cast<unsigned>(value < threshold) << (7 - i);
    }
    row[first / 8] = static_cast<std::byte>(bits);  // before all values that are still to be read
  }
}

void bits_of_nibbles(std::span<std::byte> row, std::uint32_t columns, int threshold) {
  for (std::uint32_t first = 0; first < columns; first += 8) {
    unsigned bits = 0;
    for (std::uint32_t i = 0; i < 8 && first + i < columns; ++i) {
      const auto pair = std::to_integer<unsigned>(row[(first + i) / 2]);
      const auto value = static_cast<int>(i % 2 == 0 ? pair >> 4 : pair & 15u);
      bits |= static_cast<unsigned>(17 * value < threshold) << (7 - i);
    }
    row[first / 8] = static_cast<std::byte>(bits);
  }
}

namespace {

/// The first byte of [from, to) that is another one; `to` if none is.
std::size_t first_other(std::span<const std::byte> row, std::size_t from, std::size_t to, std::byte byte) {
  std::uint64_t pattern = 0, word = 0;
  std::memset(&pattern, std::to_integer<int>(byte), sizeof pattern);
  for (; from + sizeof word <= to; from += sizeof word) {
    std::memcpy(&word, row.data() + from, sizeof word);
    if (word != pattern) break;
  }
  while (from < to && row[from] == byte) ++from;
  return from;
}

}  // namespace

bool LevelSink::add_row(std::span<const std::byte> row, std::uint32_t columns, unsigned bits, bool bright_is_low) {
  const unsigned darkest = (1u << bits) - 1;
  const auto value_at = [&](std::uint32_t column) -> unsigned {
    if (bits == 16) {
      return std::to_integer<unsigned>(row[2 * std::size_t{column}]) |
             std::to_integer<unsigned>(row[2 * std::size_t{column} + 1]) << 8;
    }
    const auto byte = std::to_integer<unsigned>(row[bits == 8 ? column : column / 2]);
    return bits == 8 ? byte : column % 2 == 0 ? byte >> 4 : byte & 15u;
  };
  for (std::uint32_t begin = 0; begin < columns;) {
    const unsigned value = value_at(begin), dark = bright_is_low != invert ? value : darkest - value;
    std::uint32_t end = begin + 1;
    if (bits == 8) end = static_cast<std::uint32_t>(first_other(row, end, columns, row[begin]));
    if (bits == 4)  // whole bytes of it from the next one on
      end =
          std::max(end, static_cast<std::uint32_t>(2 * first_other(row, (begin + 1) / 2, columns / 2, std::byte(17 * value))));
    while (end < columns && value_at(end) == value) ++end;
    if ((!nearest && dark * full % darkest != 0) || levels.level.size() >= UINT32_MAX / 2) return false;
    levels.append(begin, end, static_cast<std::uint8_t>((2 * dark * full + darkest) / (2 * darkest)));
    begin = end;
  }
  levels.end_row();
  return true;
}

}  // namespace lamina::read
