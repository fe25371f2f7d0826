// stages/formats/png/codes.h: the deflate words of rows that are filtered, in tables that are made when this is compiled.
//
// Source: RFC 1951, sections 3.2.5 (lengths and distances) and 3.2.7 (how a block tells its code). The only distance is 1:
// a match repeats the byte before it. Its code has one word, a zero bit, which here belongs to the words of the lengths.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "stages/formats/png/huffman.h"

namespace lamina::write::png {

inline constexpr std::uint32_t kSymbols = 286;  // 256 bytes, the end of the block, 29 classes of lengths
inline constexpr std::uint32_t kEndOfBlock = 256;
inline constexpr std::uint32_t kShortestMatch = 3, kLongestMatch = 258;

struct LengthClass {
  std::uint32_t symbol, extra_bits, extra;
};

/// 3 <= length <= 258.
constexpr LengthClass length_class(std::uint32_t length) {
  if (length == kLongestMatch) return {285, 0, 0};
  if (length < 11) return {254 + length, 0, 0};
  const std::uint32_t offset = length - 3;
  std::uint32_t extra_bits = 1;
  while (offset >> (extra_bits + 3) != 0) ++extra_bits;
  const std::uint32_t quarter = offset >> extra_bits;  // 4 .. 7
  return {261 + 4 * (extra_bits - 1) + quarter, extra_bits, offset - (quarter << extra_bits)};
}

/// Bytes that change where an edge is `shift` pixels to the right of the one above: a change of colour in column `above`
/// of the row above and in column `above + shift` of this one. Bytes as the Up filter has them: this row's less the one's
/// above, modulo 256. A run that begins adds ones from its column on; one that ends takes them away.
struct Edge {
  std::uint8_t bytes = 0;  // 1 or 2 that change, the first one that of the column further left; 0 if the edge stands
  std::uint8_t first = 0, second = 0;
};

inline constexpr std::int32_t kMostShift = 7;

/// above: column modulo 8; shift: -7 .. 7
constexpr Edge edge_of(bool begins, std::int32_t above, std::int32_t shift) {
  if (shift == 0) return {};
  std::uint32_t value[3] = {0, 0, 0};
  const std::int32_t low = shift < 0 ? above + shift : above;
  const std::int32_t start = low < 0 ? -8 : 0;  // of the first byte
  const auto add = [&](std::int32_t column, bool ones) {
    for (std::int32_t byte = 0; byte < 3; ++byte) {
      const std::int32_t within = column - start - 8 * byte;
      const std::uint32_t mask = within >= 8 ? 0 : within <= 0 ? 0xFFu : 0xFFu >> within;
      value[byte] += ones ? mask : 256 - mask;
    }
  };
  add(above + shift, begins);
  add(above, !begins);
  const std::int32_t last = low - start + (shift < 0 ? -shift : shift) - 1;
  return {static_cast<std::uint8_t>(last / 8 + 1), static_cast<std::uint8_t>(value[0]), static_cast<std::uint8_t>(value[1])};
}

/// Of an edge in the tables below.
constexpr std::size_t edge_index(bool begins, std::uint32_t above, std::uint32_t shift_and_seven) {
  return std::size_t{begins} << 7 | (above & 7) << 4 | shift_and_seven;
}

inline constexpr std::array<Edge, 256> kEdges = [] {
  std::array<Edge, 256> edges{};
  for (std::uint32_t index = 0; index < 256; ++index) {
    const std::int32_t shift = static_cast<std::int32_t>(index & 15) - kMostShift;
    if (shift <= kMostShift) edges[index] = edge_of(index >> 7 != 0, static_cast<std::int32_t>(index >> 4 & 7), shift);
  }
  return edges;
}();

/// How often symbols are met, beside each other. Bytes of rows that are filtered Up: 0 where nothing changes, 2 as the
/// filter's own, one bit or less one bit where an edge moves by a pixel, several bits where it moves further.
struct Weights {
  std::uint32_t zero, filter, one_pixel, few_pixels, other_bytes;
  std::uint32_t longest_match;                  // of 258 bytes
  std::array<std::uint32_t, 28> other_matches;  // by their classes
};

constexpr std::array<std::uint32_t, kSymbols> weights_of_symbols(const Weights& weights) {
  std::array<std::uint32_t, kSymbols> symbols{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) symbols[byte] = weights.other_bytes;
  for (const Edge& edge : kEdges) {
    for (std::uint32_t i = 0; i < edge.bytes; ++i) symbols[i == 0 ? edge.first : edge.second] = weights.few_pixels;
  }
  for (std::uint32_t bit = 0; bit < 8; ++bit) symbols[1u << bit] = symbols[256 - (1u << bit)] = weights.one_pixel;
  symbols[128] = 2 * weights.one_pixel;  // 128 more is 128 less
  symbols[0] = weights.zero;
  symbols[2] = weights.filter;
  symbols[kEndOfBlock] = 1;
  for (std::uint32_t i = 0; i < 28; ++i) symbols[257 + i] = weights.other_matches[i];
  symbols[285] = weights.longest_match;
  return symbols;
}

/// Zeros behind another byte are one word if there are less of them than this.
inline constexpr std::uint32_t kShortZeros = 1024;

/// What is written of an edge, in 8 bytes.
struct EdgeWord {
  std::uint32_t bits = 0;
  std::uint8_t length = 0;
  Edge edge;
};

/// A code and the words that it makes for what rows are made of.
struct Codes {
  std::array<std::uint8_t, kSymbols> length{};
  std::array<Word, 256> byte{};
  std::array<Word, kLongestMatch + 1> match{};   // by length, 3 .. 258
  std::array<Word, kLongestMatch> more_zeros{};  // behind a zero, less than a longest match
  std::array<Word, kShortZeros> zeros{};         // behind another byte
  std::array<EdgeWord, 256> edge{};              // by edge_index()
  Word end;
};

/// Literals where they are shorter than a match, and where no match is short enough.
constexpr Word more_zeros_word(const Codes& codes, std::uint32_t zeros) {
  const std::uint32_t as_bytes = zeros * codes.byte[0].length();
  if (zeros >= kShortestMatch && codes.match[zeros].length() < as_bytes) return codes.match[zeros];
  Word word;
  for (; zeros > 0; --zeros) word = join(word, codes.byte[0]);
  return word;
}

constexpr Word zeros_word(const Codes& codes, std::uint32_t zeros) {
  if (zeros == 0) return {};
  Word word = codes.byte[0];
  --zeros;
  for (; zeros >= kLongestMatch; zeros -= kLongestMatch) word = join(word, codes.match[kLongestMatch]);
  return join(word, codes.more_zeros[zeros]);
}

constexpr Codes codes_of(const Weights& weights) {
  Codes codes;
  codes.length = word_lengths(weights_of_symbols(weights));
  const std::array<Word, kSymbols> words = words_of(codes.length);
  for (std::uint32_t byte = 0; byte < 256; ++byte) codes.byte[byte] = words[byte];
  codes.end = words[kEndOfBlock];
  for (std::uint32_t length = kShortestMatch; length <= kLongestMatch; ++length) {
    const LengthClass found = length_class(length);
    const Word distance_one(0, 1);
    codes.match[length] = join(join(words[found.symbol], Word(found.extra, found.extra_bits)), distance_one);
  }
  for (std::uint32_t zeros = 0; zeros < kLongestMatch; ++zeros) codes.more_zeros[zeros] = more_zeros_word(codes, zeros);
  for (std::uint32_t zeros = 0; zeros < kShortZeros; ++zeros) codes.zeros[zeros] = zeros_word(codes, zeros);
  for (std::uint32_t index = 0; index < 256; ++index) {
    const Edge& edge = kEdges[index];
    Word word;
    if (edge.bytes > 0) word = codes.byte[edge.first];
    if (edge.bytes > 1) word = join(word, codes.byte[edge.second]);
    codes.edge[index] = {static_cast<std::uint32_t>(word.bits()), static_cast<std::uint8_t>(word.length()), edge};
  }
  return codes;
}

template <std::size_t kWords>
constexpr std::uint32_t longest(const std::array<Word, kWords>& words) {
  std::uint32_t longest = 0;
  for (const Word& word : words) longest = word.length() > longest ? word.length() : longest;
  return longest;
}

}  // namespace lamina::write::png
