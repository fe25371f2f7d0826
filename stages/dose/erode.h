// stages/dose/erode.h: erosion of runs.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/runs.h"

namespace lamina::dose {

/// The pixels around a pixel that have to be set for it to stay: an ellipse of whole pixels.
struct Reach {
  /// Columns on either side in the rows 0, 1, 2, ... above and below; empty if nothing is taken away.
  std::vector<std::uint32_t> half_width;
  bool operator==(const Reach&) const = default;
};

/// A pixel stays if and only if every pixel within reach of it is set; beyond the image nothing is set. So with a circle
/// it stays if its centre is farther than the radius from the centre of the nearest pixel that is not set.
/// cost  O(changes x log(rows of the reach)), and some operations for 8 rows of the reach at a time; nothing is expanded
void erode(const RunsView& image, const Reach& reach, Runs& result);

}  // namespace lamina::dose
