#include "stages/geometry/bits.h"

#include <algorithm>
#include <bit>
#include <cstring>

namespace lamina {
namespace {

std::uint64_t load_word(const std::byte* at, std::size_t bytes) {
  std::uint64_t word = 0;
  std::memcpy(&word, at, bytes);
  if constexpr (std::endian::native == std::endian::little) word = __builtin_bswap64(word);
  return word;
}

}  // namespace

void expand_row(std::span<const std::uint32_t> change, std::span<std::byte> row) {
  std::byte* const bytes = row.data();
  std::memset(bytes, 0, row.size());
  for (std::size_t i = 0; i + 1 < change.size(); i += 2) {
    const std::uint32_t begin = change[i], last = change[i + 1] - 1;
    const std::size_t first_byte = begin / 8, last_byte = last / 8;
    const auto head = static_cast<std::byte>(0xFFu >> (begin & 7));
    const auto tail = static_cast<std::byte>(0xFF00u >> ((last & 7) + 1));
    if (first_byte == last_byte) {
      bytes[first_byte] |= head & tail;
      continue;
    }
    bytes[first_byte] |= head;
    bytes[last_byte] |= tail;
    std::memset(bytes + first_byte + 1, 0xFF, last_byte - first_byte - 1);
  }
}

void put_words(std::span<const std::uint64_t> words, std::span<std::byte> row) {
  std::size_t at = 0;
  for (std::uint64_t word : words) {
    word = (word >> 1 & 0x5555'5555'5555'5555) | (word & 0x5555'5555'5555'5555) << 1;
    word = (word >> 2 & 0x3333'3333'3333'3333) | (word & 0x3333'3333'3333'3333) << 2;
    word = (word >> 4 & 0x0F0F'0F0F'0F0F'0F0F) | (word & 0x0F0F'0F0F'0F0F'0F0F) << 4;
    const std::size_t bytes = std::min(sizeof word, row.size() - at);
    std::memcpy(row.data() + at, &word, bytes);
    at += bytes;
  }
}

RunsBuilder::RunsBuilder(std::uint32_t columns) {
  runs_.columns = columns;
  runs_.row_offset.push_back(0);
}

bool RunsBuilder::add_row(std::span<const std::byte> row, bool invert) {
  const std::uint32_t columns = runs_.columns;
  // Rounded up to an even number a row has at most `columns` + 1 changes; growth keeps that much free.
  if (runs_.change.size() - used_ < std::size_t{columns} + 2) {
    runs_.change.resize(std::max(runs_.change.size() * 2, used_ + columns + 2));
  }
  const std::uint64_t flip = invert ? ~std::uint64_t{0} : 0;
  std::uint32_t* next = runs_.change.data() + used_;
  std::uint64_t before = 0;  // the pixel to the left, in the highest bit
  for (std::uint32_t column = 0; column < columns; column += 64) {
    const std::uint32_t left = columns - column;
    std::uint64_t word = load_word(row.data() + column / 8, left >= 64 ? 8 : row_bytes(left)) ^ flip;
    if (left < 64) word &= ~(~std::uint64_t{0} >> left);
    std::uint64_t changes = word ^ (word >> 1 | before);
    before = word << 63;
    while (changes != 0) {
      const int position = std::countl_zero(changes);
      *next++ = column + static_cast<std::uint32_t>(position);
      changes ^= std::uint64_t{1} << 63 >> position;
    }
  }
  if (before != 0) *next++ = columns;
  used_ = static_cast<std::size_t>(next - runs_.change.data());
  if (used_ > UINT32_MAX) return false;
  runs_.row_offset.push_back(static_cast<std::uint32_t>(used_));
  return true;
}

Runs RunsBuilder::finish() {
  runs_.change.resize(used_);
  used_ = 0;
  return std::move(runs_);
}

}  // namespace lamina
