// stages/formats/png/bit_writer.h: code words into bytes, least significant bit first, as deflate has them (RFC 1951, 3.1.1).
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "stages/formats/png/huffman.h"

namespace lamina::write::png {

/// Every word is followed by one unaligned 8-byte store and no branch: the bytes that it fills are final, what is
/// beyond them is overwritten by the next word. So the memory must reach 8 bytes past the last byte written.
class BitWriter {
 public:
  explicit BitWriter(std::byte* start) : next_(start) {}

  /// length <= kMostBits; bits < 2^length.
  static constexpr std::uint32_t kMostBits = 56;
  void put(std::uint64_t bits, std::uint32_t length) {
    word_ |= bits << pending_;
    pending_ += length;
    store(word_);
    next_ += pending_ >> 3;
    word_ >>= pending_ & 56;
    pending_ &= 7;
  }
  void put(Word word) { put(word.bits(), word.length()); }

  /// First byte that is not final yet.
  std::byte* next() const { return next_; }
  /// Goes on in other memory, into which the caller has copied all before next(); bits that wait come along.
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

}  // namespace lamina::write::png
