// stages/formats/png/deflate.h: Huffman codes as deflate numbers them, made when this is compiled.
//
// Source: RFC 1951, section 3.2.2 (a code follows from the lengths of its words).
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <initializer_list>

namespace lamina::formats::png {

/// Up to 56 bits, the first one lowest, and their number.
struct BitString {
  std::uint64_t packed = 0;

  constexpr BitString() = default;
  constexpr BitString(std::uint64_t bits, std::uint32_t length) : packed(bits << 8 | length) {}
  constexpr std::uint64_t bits() const { return packed >> 8; }
  constexpr std::uint32_t length() const { return static_cast<std::uint32_t>(packed & 0xFF); }
};

/// One word, then the other; 56 bits at most.
constexpr BitString join(BitString first, BitString second) {
  return BitString(first.bits() | second.bits() << first.length(), first.length() + second.length());
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
constexpr std::array<BitString, kSymbols> words_of(const std::array<std::uint8_t, kSymbols>& lengths) {
  constexpr std::uint32_t kMaxLength = 15;
  std::array<BitString, kSymbols> words{};
  std::array<std::uint32_t, kMaxLength + 1> next{};
  for (const std::uint8_t length : lengths) ++next[length];
  for (std::uint32_t length = 0, code = 0, count = 0; length <= kMaxLength; ++length) {
    code = (code + count) << 1;
    count = length > 0 ? next[length] : 0;
    next[length] = code;
  }
  for (std::size_t s = 0; s < kSymbols; ++s) {
    const std::uint32_t length = lengths[s];
    if (length == 0) continue;
    std::uint32_t turned = next[length]++;
    turned = (turned & 0x5555) << 1 | (turned >> 1 & 0x5555);
    turned = (turned & 0x3333) << 2 | (turned >> 2 & 0x3333);
    turned = (turned & 0x0F0F) << 4 | (turned >> 4 & 0x0F0F);
    turned = (turned & 0x00FF) << 8 | turned >> 8;
    words[s] = BitString(turned >> (kMaxLength + 1 - length), length);
  }
  return words;
}

// --- code words into bytes, least significant bit first, as deflate has them (RFC 1951, 3.1.1).

/// Every word is followed by one unaligned 8-byte store and no branch: the bytes that it fills are final, what is
/// beyond them is overwritten by the next word. So the memory must reach 8 bytes past the last byte written.
class BitWriter {
 public:
  explicit BitWriter(std::byte* start) : next_(start) {}

  /// length <= kMaxBits; bits < 2^length.
  static constexpr std::uint32_t kMaxBits = 56;
  void put(std::uint64_t bits, std::uint32_t length) {
    word_ |= bits << pending_;
    pending_ += length;
    store(word_);
    next_ += pending_ >> 3;
    word_ >>= pending_ & 56;
    pending_ &= 7;
  }
  void put(BitString word) { put(word.bits(), word.length()); }

  /// First byte that is not final yet.
  std::byte* next() const { return next_; }
  /// Continues in other memory, into which the caller has copied all before next(); bits that wait come along.
  void move_to(std::byte* next) { next_ = next; }
  /// Fills the last byte up with zeros; the end of what was written.
  std::byte* finish() {
    if (pending_ != 0) put(0, 8 - pending_);
    return next_;
  }

 private:
  void store(std::uint64_t word) {
    if constexpr (std::endian::native == std::endian::big) word = __builtin_bswap64(word);
    std::memcpy(next_, &word, sizeof word);
  }

  std::uint64_t word_ = 0;     // the lowest `pending_` bits wait for the rest of their byte; above is 0
  std::uint32_t pending_ = 0;  // 0 .. 7 between words
  std::byte* next_;
};

// --- the deflate words of rows that are filtered, in tables that are made when this is compiled.
//
// Source: RFC 1951, sections 3.2.5 (lengths and distances) and 3.2.7 (how a block states its code). The only distance is 1:
// a match repeats the byte before it. Its code has one word, a zero bit, which here belongs to the words of the lengths.

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
struct RunEdge {
  std::uint8_t bytes = 0;  // 1 or 2 that change, the first one that of the column further left; 0 if the edge stands
  std::uint8_t first = 0, second = 0;
};

inline constexpr std::int32_t kMaxShift = 7;

/// above: column modulo 8; shift: -7 .. 7
constexpr RunEdge edge_of(bool begins, std::int32_t above, std::int32_t shift) {
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

inline constexpr std::array<RunEdge, 256> kEdges = [] {
  std::array<RunEdge, 256> edges{};
  for (std::uint32_t index = 0; index < 256; ++index) {
    const std::int32_t shift = static_cast<std::int32_t>(index & 15) - kMaxShift;
    if (shift <= kMaxShift) edges[index] = edge_of(index >> 7 != 0, static_cast<std::int32_t>(index >> 4 & 7), shift);
  }
  return edges;
}();

/// Relative frequencies of symbols. Bytes of rows that are filtered Up: 0 where nothing changes, 2 as the
/// filter's own, one bit or less one bit where an edge moves by a pixel, several bits where it moves further.
struct Weights {
  std::uint32_t zero, filter, one_pixel, few_pixels, other_bytes;
  std::uint32_t longest_match;                  // of 258 bytes
  std::array<std::uint32_t, 28> other_matches;  // by their classes
};

constexpr std::array<std::uint32_t, kSymbols> weights_of_symbols(const Weights& weights) {
  std::array<std::uint32_t, kSymbols> symbols{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) symbols[byte] = weights.other_bytes;
  for (const RunEdge& edge : kEdges) {
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
  RunEdge edge;
};

/// A code and the words that it makes for what rows are made of.
struct Codes {
  std::array<std::uint8_t, kSymbols> length{};
  std::array<BitString, 256> byte{};
  std::array<BitString, kLongestMatch + 1> match{};   // by length, 3 .. 258
  std::array<BitString, kLongestMatch> more_zeros{};  // behind a zero, less than a longest match
  std::array<BitString, kShortZeros> zeros{};         // behind another byte
  std::array<EdgeWord, 256> edge{};                   // by edge_index()
  BitString end;
};

/// Literals where they are shorter than a match, and where no match is short enough.
constexpr BitString more_zeros_word(const Codes& codes, std::uint32_t zeros) {
  const std::uint32_t as_bytes = zeros * codes.byte[0].length();
  if (zeros >= kShortestMatch && codes.match[zeros].length() < as_bytes) return codes.match[zeros];
  BitString word;
  for (; zeros > 0; --zeros) word = join(word, codes.byte[0]);
  return word;
}

constexpr BitString zeros_word(const Codes& codes, std::uint32_t zeros) {
  if (zeros == 0) return {};
  BitString word = codes.byte[0];
  --zeros;
  for (; zeros >= kLongestMatch; zeros -= kLongestMatch) word = join(word, codes.match[kLongestMatch]);
  return join(word, codes.more_zeros[zeros]);
}

constexpr Codes codes_of(const Weights& weights) {
  Codes codes;
  codes.length = word_lengths(weights_of_symbols(weights));
  const std::array<BitString, kSymbols> words = words_of(codes.length);
  for (std::uint32_t byte = 0; byte < 256; ++byte) codes.byte[byte] = words[byte];
  codes.end = words[kEndOfBlock];
  for (std::uint32_t length = kShortestMatch; length <= kLongestMatch; ++length) {
    const LengthClass found = length_class(length);
    const BitString distance_one(0, 1);
    codes.match[length] = join(join(words[found.symbol], BitString(found.extra, found.extra_bits)), distance_one);
  }
  for (std::uint32_t zeros = 0; zeros < kLongestMatch; ++zeros) codes.more_zeros[zeros] = more_zeros_word(codes, zeros);
  for (std::uint32_t zeros = 0; zeros < kShortZeros; ++zeros) codes.zeros[zeros] = zeros_word(codes, zeros);
  for (std::uint32_t index = 0; index < 256; ++index) {
    const RunEdge& edge = kEdges[index];
    BitString word;
    if (edge.bytes > 0) word = codes.byte[edge.first];
    if (edge.bytes > 1) word = join(word, codes.byte[edge.second]);
    codes.edge[index] = {static_cast<std::uint32_t>(word.bits()), static_cast<std::uint8_t>(word.length()), edge};
  }
  return codes;
}

template <std::size_t kWords>
constexpr std::uint32_t longest(const std::array<BitString, kWords>& words) {
  std::uint32_t longest = 0;
  for (const BitString& word : words) longest = word.length() > longest ? word.length() : longest;
  return longest;
}

// --- how a deflate block states its code (RFC 1951, section 3.2.7).

/// Bits in the order in which they are written, 32 a word.
struct BlockHead {
  std::array<std::uint32_t, 48> words{};
  std::uint32_t bits = 0;

  constexpr void put(BitString word) {
    for (std::uint32_t i = 0; i < word.length(); ++i, ++bits) {
      words[bits / 32] |= static_cast<std::uint32_t>(word.bits() >> i & 1) << bits % 32;
    }
  }
};

/// The last block of its stream. All symbols have words, and so has distance 1, a single bit. Lengths of words are stated in
/// a code of their own, whose symbol 16 repeats the one before 3 to 6 times.
constexpr BlockHead block_head(const Codes& codes) {
  constexpr std::uint32_t kRepeat = 16, kLengths = kSymbols + 1, kLengthSymbols = 19;
  std::array<std::uint8_t, kLengths> reported{};
  std::array<std::uint32_t, kLengths> times{};  // that follow a stated length; 0 or 3 .. 6
  std::uint32_t count = 0;
  const auto length = [&](std::uint32_t s) { return s < kSymbols ? codes.length[s] : std::uint8_t{1}; };
  std::array<std::uint32_t, kLengthSymbols> weights{};
  for (std::uint32_t s = 0; s < kLengths;) {
    std::uint32_t like = 0;
    if (s > 0 && length(s) == length(s - 1)) {
      while (like < 6 && s + like < kLengths && length(s + like) == length(s)) ++like;
    }
    reported[count] = like >= 3 ? std::uint8_t{kRepeat} : length(s);
    times[count] = like >= 3 ? like : 0;
    s += like >= 3 ? like : 1;
    ++weights[reported[count++]];
  }
  const auto lengths = word_lengths(weights);
  const auto words = words_of(lengths);

  BlockHead head;
  head.put(BitString(1, 1));               // the last block
  head.put(BitString(2, 2));               // which states its code
  head.put(BitString(kSymbols - 257, 5));  // HLIT
  head.put(BitString(0, 5));               // HDIST: one distance
  constexpr std::array<std::uint8_t, kLengthSymbols> kOrder = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                                               11, 4,  12, 3, 13, 2, 14, 1, 15};
  std::uint32_t used = kLengthSymbols;
  while (lengths[kOrder[used - 1]] == 0) --used;
  head.put(BitString(used - 4, 4));  // HCLEN
  for (std::uint32_t i = 0; i < used; ++i) head.put(BitString(lengths[kOrder[i]], 3));
  for (std::uint32_t i = 0; i < count; ++i) {
    head.put(words[reported[i]]);
    if (reported[i] == kRepeat) head.put(BitString(times[i] - 3, 2));
  }
  return head;
}

// --- the codes of images, one of which is taken by how much of the image changes.

struct Table {
  Codes codes;
  BlockHead head;
};

/// For rows of this many bytes that change colour this often in all.
const Table& table_for(std::uint64_t bytes, std::uint64_t changes);

}  // namespace lamina::formats::png
