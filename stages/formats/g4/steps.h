// stages/formats/g4/steps.h: code words of many changes at once, a body for each instruction set.
#pragma once

#include <algorithm>
#include <cstdint>

#include "stages/data/choices.h"
#include "stages/formats/g4/bit_writer.h"

namespace lamina::formats::g4 {

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

/// The body for an instruction set that this processor has (geometry/isa.h), not kAuto; nullptr: none is faster than coding
/// row by row.
const StepsBody* steps_body(Isa isa);

namespace avx2 {
void put_steps(BitWriter& writer, StepsTask& task, Steps& steps);
}
namespace avx512 {
void put_steps(BitWriter& writer, StepsTask& task, Steps& steps);
}

}  // namespace lamina::formats::g4
