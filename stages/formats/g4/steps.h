// stages/formats/g4/steps.h: code words into bytes, most significant bit first, and those of many changes at once.
#pragma once

#include <algorithm>
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

// --- code words of many changes at once, a body for each instruction set.

/// Which of the next changes are the last of their rows.
class RowEnds {
 public:
  RowEnds(std::uint32_t changes, std::uint32_t lanes) : changes_(changes), step_(lanes % changes) {
    for (std::uint32_t end = changes; end <= 64; end += changes) pattern_ |= std::uint64_t{1} << (end - 1);
  }
  /// Bit i: change i from here, i < 16.
  std::uint32_t bits() const {
    if (changes_ <= 48) return static_cast<std::uint32_t>(pattern_ >> position_) & 0xFFFF;
    const std::uint32_t left = changes_ - 1 - position_;
    return left < 16 ? 1u << left : 0;
  }
  void advance(std::uint32_t count) {
    position_ += count;
    if (position_ >= changes_) position_ %= changes_;
  }
  /// By as many as a body has lanes: nothing here waits for what it finds.
  void advance_all() {
    position_ += step_;
    position_ -= position_ >= changes_ ? changes_ : 0;
  }
  /// Of the next change in its row.
  std::uint32_t position() const { return position_; }

 private:
  std::uint32_t changes_, step_, position_ = 0;
  std::uint64_t pattern_ = 0;
};

/// Changes of rows that have as many changes as the row above each of them has: the change above lies `changes` before its own.
struct StepsTask {
  const std::uint32_t* change;  // the next; nothing behind the last one is read
  std::uint32_t left;           // from that on, up to the end of a row
  std::uint32_t changes;        // of a row
  std::uint32_t columns;
  RowEnds ends;  // from that change on
};

/// What the bodies find of as many changes as they have lanes; bit i is of change i.
struct Steps {
  /// Change i comes before the change above that follows its own, and the next change not before its own: T.6's b1 is then the
  /// change above of the same number, and none takes pass mode, if all changes before it in its row keep step too. The last of
  /// a row also comes before the last column.
  std::uint32_t keeps;
  std::uint32_t far;         // more than 3 columns from the change above
  std::uint32_t count;       // changes from the first on that keep step and are near
  std::uint32_t lengths[2];  // bits of both words, 60 at most
  std::uint64_t words[2];    // the code words of those, and after the last change of a row that of the row's end
};

inline void put_words(BitWriter& writer, const Steps& steps) {
  const std::uint32_t length = steps.lengths[0] + steps.lengths[1];
  if (length <= 56) [[likely]] {
    writer.put(steps.words[0] << steps.lengths[1] | steps.words[1], length);
    return;
  }
  for (int i = 0; i < 2; ++i) {
    if (steps.lengths[i] > 32) writer.put(steps.words[i] >> 32, steps.lengths[i] - 32);
    const std::uint32_t low = std::min(steps.lengths[i], 32u);
    if (low != 0) writer.put(steps.words[i] & ((std::uint64_t{1} << low) - 1), low);
  }
}

struct StepsBody {
  std::uint32_t lanes;
  /// Writes changes as long as all lanes keep step and are near, and moves the task on; then, if any are left, finds the steps
  /// of the next, which are not all so or are the last.
  void (*put)(BitWriter& writer, StepsTask& task, Steps& steps);
};

namespace avx2 {
void put_steps(BitWriter& writer, StepsTask& task, Steps& steps);
}
namespace avx512 {
void put_steps(BitWriter& writer, StepsTask& task, Steps& steps);
}

}  // namespace lamina::formats::g4
