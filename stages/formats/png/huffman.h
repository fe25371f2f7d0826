// stages/formats/png/huffman.h: Huffman codes as deflate numbers them, made when this is compiled.
//
// Source: RFC 1951, section 3.2.2 (a code follows from the lengths of its words).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>

namespace lamina::write::png {

/// Up to 56 bits, the first one lowest, and their number.
struct Word {
  std::uint64_t packed = 0;

  constexpr Word() = default;
  constexpr Word(std::uint64_t bits, std::uint32_t length) : packed(bits << 8 | length) {}
  constexpr std::uint64_t bits() const { return packed >> 8; }
  constexpr std::uint32_t length() const { return static_cast<std::uint32_t>(packed & 0xFF); }
};

/// One word, then the other; 56 bits at most.
constexpr Word join(Word first, Word second) {
  return Word(first.bits() | second.bits() << first.length(), first.length() + second.length());
}

/// Lengths of the words of an optimal code (Huffman 1952) by the weights of the symbols; 0 for a symbol of no weight.
/// needs  two symbols of some weight
template <std::size_t kSymbols>
constexpr std::array<std::uint8_t, kSymbols> word_lengths(const std::array<std::uint32_t, kSymbols>& weights) {
  std::array<std::uint16_t, kSymbols> order{};  // of the leaves, light ones first
  std::size_t leaves = 0;
  for (std::size_t s = 0; s < kSymbols; ++s) {
    if (weights[s] != 0) order[leaves++] = static_cast<std::uint16_t>(s);
  }
  std::sort(order.begin(), order.begin() + leaves,
            [&](std::uint16_t a, std::uint16_t b) { return weights[a] != weights[b] ? weights[a] < weights[b] : a < b; });
  // Nodes: the leaves, then those that join two. The latter are made in the order of their weights, so that the lightest
  // node left is the next leaf or the next of them.
  std::array<std::uint64_t, 2 * kSymbols> weight{};
  std::array<std::uint16_t, 2 * kSymbols> parent{}, depth{};
  for (std::size_t i = 0; i < leaves; ++i) weight[i] = weights[order[i]];
  std::size_t leaf = 0, joined = leaves;
  for (std::size_t node = leaves; node < 2 * leaves - 1; ++node) {
    for (int child = 0; child < 2; ++child) {
      const bool take_leaf = leaf < leaves && (joined == node || weight[leaf] <= weight[joined]);
      const std::size_t taken = take_leaf ? leaf++ : joined++;
      weight[node] += weight[taken];
      parent[taken] = static_cast<std::uint16_t>(node);
    }
  }
  std::array<std::uint8_t, kSymbols> lengths{};
  for (std::size_t node = 2 * leaves - 2; node-- > 0;) {
    depth[node] = static_cast<std::uint16_t>(depth[parent[node]] + 1);
    if (node < leaves) lengths[order[node]] = static_cast<std::uint8_t>(depth[node]);
  }
  return lengths;
}

/// The words: of one length in the order of their symbols, shorter ones first (RFC 1951, 3.2.2). In a stream their highest
/// bit comes first, so it stands lowest here.
template <std::size_t kSymbols>
constexpr std::array<Word, kSymbols> words_of(const std::array<std::uint8_t, kSymbols>& lengths) {
  std::array<Word, kSymbols> words{};
  std::uint32_t code = 0;
  for (std::uint32_t length = 1; length <= 15; ++length, code <<= 1) {
    for (std::size_t s = 0; s < kSymbols; ++s) {
      if (lengths[s] != length) continue;
      std::uint32_t turned = 0;
      for (std::uint32_t bit = 0; bit < length; ++bit) turned |= (code >> bit & 1) << (length - 1 - bit);
      words[s] = Word(turned, length);
      ++code;
    }
  }
  return words;
}

}  // namespace lamina::write::png
