// stages/formats/g4/bit_writer.h: code words into bytes, most significant bit first.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>

#include "stages/geometry/t6_codes.h"

namespace lamina::formats::g4 {

using namespace lamina::t6;

/// Every word is followed by one unaligned 8-byte store and no branch: the bytes that it fills are final, what is
/// beyond them is overwritten by the next word. So the memory must reach 8 bytes past the last byte written.
class BitWriter {
 public:
  explicit BitWriter(std::byte* start) : next_(start) {}

  /// 1 <= length <= 56; bits < 2^length.
  void put(std::uint64_t bits, std::uint32_t length) {
    word_ = word_ << length | bits;
    pending_ += length;
    store(word_ << (64 - pending_));
    next_ += pending_ >> 3;
    pending_ &= 7;
  }
  void put(Code code) { put(code.bits(), code.length()); }

  void put_ones(std::uint64_t count) {
    if (count > 128) {
      const std::uint32_t head = (8 - pending_) & 7;  // up to the next whole byte
      if (head != 0) put((1u << head) - 1, head);
      count -= head;
      std::memset(next_, 0xFF, count / 8);
      next_ += count / 8;
      count &= 7;
    }
    for (; count > 56; count -= 56) put((std::uint64_t{1} << 56) - 1, 56);
    if (count != 0) put((std::uint64_t{1} << count) - 1, static_cast<std::uint32_t>(count));
  }

  /// First byte that is not final yet.
  std::byte* next() const { return next_; }
  /// Continues in other memory, into which the caller has copied all before next() and, if any bit waits, its byte.
  void move_to(std::byte* next) { next_ = next; }
  /// Fills the last byte up with zeros; the end of what was written.
  std::byte* finish() const { return next_ + (pending_ != 0 ? 1 : 0); }

 private:
  void store(std::uint64_t aligned) {
    if constexpr (std::endian::native == std::endian::little) aligned = __builtin_bswap64(aligned);
    std::memcpy(next_, &aligned, sizeof aligned);
  }

  std::uint64_t word_ = 0;     // the lowest `pending_` bits wait for the rest of their byte; above is history
  std::uint32_t pending_ = 0;  // 0 .. 7 between words
  std::byte* next_;
};

}  // namespace lamina::formats::g4
