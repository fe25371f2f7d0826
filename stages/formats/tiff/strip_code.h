// stages/formats/tiff/strip_code.h: the code of one strip of deflate, whose matches have a distance of 1 or 16 bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "stages/formats/png/deflate.h"

namespace lamina::formats::tiff {

using StripWeights = std::array<std::uint32_t, png::kSymbols>;

/// Counts a match of any length; its last one or two bytes are literals, which the caller counts.
void count_match(std::size_t length, StripWeights& weights);
/// The same as StripCode::put_whole_match() puts it.
void count_whole_match(std::size_t length, StripWeights& weights);

class StripCode {
 public:
  /// Upper bound of a stream: no code of all symbols takes more than 9 bits a symbol.
  static constexpr std::size_t bound(std::size_t bytes) { return bytes + bytes / 4 + 1024; }

  /// near  whether matches have a distance of 1 byte too
  explicit StripCode(bool near) : near_(near) {}
  /// weights  how often each symbol occurs, at least 1
  void make(const StripWeights& weights);
  /// What zlib has before a block, and one block's statement of its code (RFC 1951, 3.2.7).
  png::BitWriter start(std::byte* out) const;
  png::BitString of_byte(std::byte of) const { return byte_[static_cast<std::uint8_t>(of)]; }
  /// Literals in a row.
  void put(const std::byte* at, std::size_t count, png::BitWriter& writer) const;
  /// A match at distance 16 but for its last one or two bytes. returns  how many these are
  std::uint32_t put_match(std::size_t length, png::BitWriter& writer) const;
  /// All of a match of 3 bytes or more. far  at distance 16, else 1
  void put_whole_match(std::size_t length, bool far, png::BitWriter& writer) const;
  /// Ends the block and the stream. returns  one past its last byte
  std::byte* finish(std::uint32_t adler, png::BitWriter& writer) const;

 private:
  void put_head(png::BitWriter& writer) const;
  png::BitString back_of(bool far) const;

  bool near_;
  std::array<std::uint8_t, png::kSymbols> lengths_{};
  std::array<png::BitString, 256> byte_{};
  std::array<png::BitString, png::kLongestMatch + 1> match_{};
  png::BitString end_;
};

}  // namespace lamina::formats::tiff
