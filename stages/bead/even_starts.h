// stages/bead/even_starts.h: lines begin with the flow they keep, regardless of the previous line.
//
// The melt lags (stages/bead/line.h): after a faster line a line begins too thick, after a slower one too thin, until the
// transient has decayed after some tenths of a millimetre. The first 0.2 mm of a line, or as much as keeps the feed between a
// twentieth and three times its own, are fed more or less such that the flow at their end is that of the line. Nothing is fed
// or retracted for it while the head stands still. Within a line nothing is changed: segmented lines depend on the lag.
// Assumed: travels and retractions keep what the melt holds; lines begin and end with their own speeds. Braking at ends is the
// same for all lines, and what it leaves behind is left alone.
#pragma once

#include <optional>

#include "stages/bead/line.h"
#include "stages/data/extruder.h"
#include "stages/data/toolpaths.h"

namespace lamina::bead {

/// Takes the moves of a layer in the order in which they are deposited. The first line of a layer is left as it is.
/// cost  some ten exponentials a move
class EvenStarts {
 public:
  /// machine  material.lag_s > 0: without a lag there is nothing to make even
  /// height   of the layer, mm
  EvenStarts(const Extruder& machine, double height_mm);

  /// Moves deposited without this object are unknown: the next line is left as it is.
  void forget() { known_ = false; }

  /// Calls deposit(const BeadMove&) with the move, or with two pieces of it.
  /// returns  the sum of both; nothing if `deposit` stops
  template <class Deposit>
  std::optional<DepositedMove> deposit(const BeadMove& move, Deposit&& deposit) {
    const MovePieces pieces = take(move);
    DepositedMove sum{};
    for (int i = 0; i < pieces.count; ++i) {
      const std::optional<DepositedMove> deposited = deposit(pieces.move[i]);
      if (!deposited) return std::nullopt;
      sum.length_mm += deposited->length_mm;
      sum.volume_mm3 += deposited->volume_mm3;
    }
    return sum;
  }

 private:
  struct MovePieces {
    BeadMove move[2];
    int count = 1;
  };
  MovePieces take(const BeadMove& move);
  /// A move of a line that is not even yet.
  MovePieces made_even(const BeadMove& move);

  double lag_;
  BeadLine line_;              // since the line is even
  double speed_ = 0;           // of the last move
  double left_ = 0, own_ = 0;  // mm3/s: the flow that runs, and that of the line, until it is even
  bool even_ = true;
  bool known_ = false;  // whether a line was deposited
};

}  // namespace lamina::bead
