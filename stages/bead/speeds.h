// stages/bead/speeds.h: the speed of the head along a line, decided as far ahead as it has to be and no further.
//
// A planner joins two stretches at the slower of their two speeds: what changes, changes within the faster one. Where a stretch
// is too short for that the speed at its beginning is lower. A speed at a joint is final as soon as it is the same whether
// the head stops behind the last stretch that is known or goes on, so that what waits is as long as a braking distance.
#pragma once

#include <cstddef>
#include <span>

#include "stages/bead/machine.h"
#include "stages/data/buffer.h"

namespace lamina::bead {

/// A stretch and the speeds at its two ends.
struct Planned {
  Stretch stretch;
  double begin_mm_s, end_mm_s;
  /// The highest speed within it: that of the stretch, or less where it is short.
  double peak(double acceleration_mm_s2) const;
};

/// Takes the stretches of a line one after another.
class SpeedPlan {
 public:
  explicit SpeedPlan(double acceleration_mm_s2) : acceleration_(acceleration_mm_s2) {}

  /// A new line; nothing may wait. speed  that the line before joins with; faster than the first stretch: it is left at once
  void begin(double speed_mm_s) { speed_ = speed_mm_s; }
  void add(const Stretch& stretch) { waiting_.push_back(stretch); }
  /// The line ends with this speed. Whoever says so takes all that waits.
  bool take_last(double speed_mm_s, Planned& out);
  /// The next stretch whose speeds are final. cost  O(stretches that wait)
  bool take(Planned& out);

  std::size_t waiting() const { return waiting_.size() - first_; }

 private:
  double end_of_first(double last_mm_s) const;
  bool give(double end_mm_s, Planned& out);

  double acceleration_, speed_ = 0;
  Buffer<Stretch> waiting_;
  std::size_t first_ = 0;  // those before it were taken
};

/// The speed with which a pattern that is repeated without end begins each time.
/// errors  none; an empty pattern has 0
double cyclic_speed(std::span<const Stretch> period, double acceleration_mm_s2);

}  // namespace lamina::bead
