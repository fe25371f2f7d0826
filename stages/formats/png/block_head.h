// stages/formats/png/block_head.h: how a deflate block tells its code (RFC 1951, section 3.2.7).
#pragma once

#include <array>
#include <cstdint>
#include <initializer_list>

#include "stages/formats/png/codes.h"

namespace lamina::write::png {

/// Bits in the order in which they are written, 32 a word.
struct BlockHead {
  std::array<std::uint32_t, 48> words{};
  std::uint32_t bits = 0;

  constexpr void put(Word word) {
    for (std::uint32_t i = 0; i < word.length(); ++i, ++bits) {
      words[bits / 32] |= static_cast<std::uint32_t>(word.bits() >> i & 1) << bits % 32;
    }
  }
};

/// The last block of its stream. All symbols have words, and so has distance 1, a single bit. Lengths of words are told in
/// a code of their own, whose symbol 16 repeats the one before 3 to 6 times.
constexpr BlockHead block_head(const Codes& codes) {
  constexpr std::uint32_t kRepeat = 16, kLengths = kSymbols + 1, kLengthSymbols = 19;
  std::array<std::uint8_t, kLengths> told{};
  std::array<std::uint32_t, kLengths> times{};  // that follow a length told; 0 or 3 .. 6
  std::uint32_t count = 0;
  const auto length = [&](std::uint32_t s) { return s < kSymbols ? codes.length[s] : std::uint8_t{1}; };
  std::array<std::uint32_t, kLengthSymbols> weights{};
  for (std::uint32_t s = 0; s < kLengths;) {
    std::uint32_t like = 0;
    if (s > 0 && length(s) == length(s - 1)) {
      while (like < 6 && s + like < kLengths && length(s + like) == length(s)) ++like;
    }
    told[count] = like >= 3 ? std::uint8_t{kRepeat} : length(s);
    times[count] = like >= 3 ? like : 0;
    s += like >= 3 ? like : 1;
    ++weights[told[count++]];
  }
  const auto lengths = word_lengths(weights);
  const auto words = words_of(lengths);

  BlockHead head;
  head.put(Word(1, 1));               // the last block
  head.put(Word(2, 2));               // which tells its code
  head.put(Word(kSymbols - 257, 5));  // HLIT
  head.put(Word(0, 5));               // HDIST: one distance
  constexpr std::array<std::uint8_t, kLengthSymbols> kOrder = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                               11, 4,  12, 3, 13, 2, 14, 1, 15};
  std::uint32_t used = kLengthSymbols;
  while (lengths[kOrder[used - 1]] == 0) --used;
  head.put(Word(used - 4, 4));  // HCLEN
  for (std::uint32_t i = 0; i < used; ++i) head.put(Word(lengths[kOrder[i]], 3));
  for (std::uint32_t i = 0; i < count; ++i) {
    head.put(words[told[i]]);
    if (told[i] == kRepeat) head.put(Word(times[i] - 3, 2));
  }
  return head;
}

}  // namespace lamina::write::png
