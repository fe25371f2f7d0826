// stages/formats/gcode/wipe_trail.h: the end of the bead that the nozzle deposited last, for wiping back along it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/units.h"

namespace lamina::formats::gcode {

/// The last kMaxPoints points since a travel at least. Grows to its capacity once.
class WipeTrail {
 public:
  static constexpr std::size_t kMaxPoints = 256;
  static constexpr double kMinLine = 2e-3;  // mm: nearer points are left out, as files have whole micrometres

  void restart(Point2 at) {
    point_.clear();
    point_.push_back(at);
  }
  void add(Point2 to) {
    if (point_.size() == 2 * kMaxPoints) point_.erase(point_.begin(), point_.begin() + kMaxPoints);
    point_.push_back(to);
  }

  /// Leads back over the trail. visit(point, mm from the last one)  for each point at which it turns, and its end
  /// returns  mm, at most `length_mm`
  template <class Visit>
  double back(double length_mm, const Visit& visit) const {
    if (point_.empty()) return 0;
    double way = 0;
    Point2 at = point_.back();
    for (std::size_t i = point_.size() - 1; i-- > 0 && length_mm - way >= kMinLine;) {
      const Point2 b = point_[i];
      const double dx = mm(std::int64_t{b.x} - at.x), dy = mm(std::int64_t{b.y} - at.y), length = std::hypot(dx, dy);
      if (length < kMinLine) continue;
      const double share = std::min(1.0, (length_mm - way) / length);
      const Point2 to = share < 1 ? Point2{static_cast<Nm>(at.x + std::llround(dx * share * 1e6)),
                                           static_cast<Nm>(at.y + std::llround(dy * share * 1e6))}
                                  : b;
      way += length * share;
      visit(to, length * share);
      at = to;
    }
    return way;
  }

 private:
  Buffer<Point2> point_;
};

}  // namespace lamina::formats::gcode
