// stages/write/g4/steps.h: code words of many changes at once, a body for each instruction set.
#pragma once

#include <cstdint>

#include "stages/data/choices.h"

namespace lamina::write::g4 {

/// Changes of rows that have as many changes as the row above each of them has: the change above lies `changes` before its own.
struct StepsTask {
  const std::uint32_t* row;     // where a row begins: rows have pairs, so that even places from here are changes to black
  const std::uint32_t* change;  // the first of them; nothing behind the last one is read, but the next of its row
  std::uint32_t changes;        // of a row
  std::uint32_t columns;
  std::uint32_t count;  // 1 .. lanes of the body
  std::uint32_t ends;   // bit i: change i is the last of its row
};

/// What the bodies find; bit i is of change i.
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

struct StepsBody {
  std::uint32_t lanes;
  std::uint32_t most_changes;  // of rows for which it is faster than coding row by row
  void (*find)(const StepsTask& task, Steps& steps);
};

/// The body for an instruction set that this processor has (geometry/isa.h), not kAuto; nullptr: none is faster than coding
/// row by row.
const StepsBody* steps_body(Isa isa);

namespace avx2 {
void find_steps(const StepsTask& task, Steps& steps);
}
namespace avx512 {
void find_steps(const StepsTask& task, Steps& steps);
}

}  // namespace lamina::write::g4
