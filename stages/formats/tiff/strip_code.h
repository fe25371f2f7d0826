// stages/formats/tiff/strip_code.h: the code of one strip of deflate, whose matches have one of a few distances.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "stages/formats/png/deflate.h"

namespace lamina::formats::tiff {

using StripWeights = std::array<std::uint32_t, png::kSymbols>;

/// A distance of a match, and how deflate states it (RFC 1951, 3.2.5).
struct StripDistance {
  std::size_t bytes;
  std::uint32_t symbol, extra, extra_bits;
  png::BitString word;  // of the strip's code
};

/// Counts a match of any length; its last one or two bytes are literals, which the caller does not count.
void count_match(std::size_t length, StripWeights& weights);
/// The same as StripCode::put_whole_match() puts it.
void count_whole_match(std::size_t length, StripWeights& weights);

class StripCode {
 public:
  static constexpr std::size_t kMaxDistances = 4, kFew = 2;
  /// Upper bound of a stream: no code of all symbols takes more than 9 bits a symbol.
  static constexpr std::size_t bound(std::size_t bytes) { return bytes + bytes / 4 + 1024; }

  /// Removes all distances.
  void clear_distances() { distances_ = 0; }
  /// Adds a distance of up to 32 KiB, unless another one has its symbol; up to 4. The first one gets the shortest word.
  void add_distance(std::size_t bytes);
  /// By number, in the order in which they were added.
  std::span<const StripDistance> distances() const { return std::span(distance_).first(distances_); }
  /// weights  how often each symbol occurs, at least 1
  void make(const StripWeights& weights);
  /// What zlib has before a block, and one block's statement of its code (RFC 1951, 3.2.7).
  png::BitWriter start(std::byte* out) const;
  png::BitString of_byte(std::byte of) const { return byte_[static_cast<std::uint8_t>(of)]; }
  /// Literals in a row.
  void put(const std::byte* at, std::size_t count, png::BitWriter& writer) const;
  /// Of byte number `i`, or 256 more if it is not among the first `count` ones: those have empty words. Without a branch.
  static std::size_t index_of(const std::byte* at, std::size_t i, std::size_t count) {
    return ((count - i - 1) >> 55 & 256) | static_cast<std::size_t>(at[i]);
  }
  /// Up to kFew of them, where so many bytes can be read, and a match of 3 to 258 bytes.
  void put_few(const std::byte* at, std::size_t count, std::size_t length, std::size_t distance, png::BitWriter& writer) const {
    const png::BitString literals = join(byte_[index_of(at, 0, count)], byte_[index_of(at, 1, count)]);
    const png::BitString match = join(match_[length], distance_[distance].word);
    if (literals.length() + match.length() <= png::BitWriter::kMaxBits) return writer.put(join(literals, match));
    writer.put(literals);
    writer.put(match);
  }
  /// A match but for its last one or two bytes. distance  its number. returns  how many these are
  std::uint32_t put_match(std::size_t length, std::size_t distance, png::BitWriter& writer) const {
    const png::BitString back = distance_[distance].word;
    for (; length > png::kLongestMatch; length -= png::kLongestMatch) writer.put(join(match_[png::kLongestMatch], back));
    if (length < png::kShortestMatch) return static_cast<std::uint32_t>(length);
    writer.put(join(match_[length], back));
    return 0;
  }
  /// All of a match of 3 bytes or more.
  void put_whole_match(std::size_t length, std::size_t distance, png::BitWriter& writer) const;
  /// Ends the block and the stream. returns  one past its last byte
  std::byte* finish(std::uint32_t adler, png::BitWriter& writer) const;

 private:
  void make_symbols(const StripWeights& weights);
  void put_head(png::BitWriter& writer) const;

  static constexpr std::size_t kDistanceSymbols = 30;
  std::array<StripDistance, kMaxDistances> distance_{};
  std::size_t distances_ = 0;
  std::array<std::uint8_t, kDistanceSymbols> distance_lengths_{};
  std::array<std::uint8_t, png::kSymbols> lengths_{};
  std::array<png::BitString, 512> byte_{};  // and as many empty ones
  std::array<png::BitString, png::kLongestMatch + 1> match_{};
  png::BitString end_;
  StripWeights weights_{};  // that the words of symbols are of
};

}  // namespace lamina::formats::tiff
