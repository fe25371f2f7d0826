// stages/dose/edges/erode.h: what is left of an image when all that is near to its edge is taken away, on runs.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/runs.h"

namespace lamina::dose {

/// The pixels around a pixel that have to be set for it to stay: an ellipse of whole pixels.
struct Reach {
  /// Columns on either side in the rows 0, 1, 2, ... above and below; empty if nothing is taken away.
  std::vector<std::uint32_t> half_width;
  bool operator==(const Reach&) const = default;
};

/// All offsets (i columns, j rows) with (i px / x)^2 + (j py / y)^2 <= 1, decided in integers; px and py are the pitches in
/// whole picometres, x and y the half axes in whole nanometres. With an axis of 0 only offsets along the other one count.
/// x_nm, y_nm  0 .. 10^7, or equal and up to 10^9
Reach reach_of(const PixelGrid& grid, std::int64_t x_nm, std::int64_t y_nm);

/// A pixel stays if and only if every pixel within reach of it is set; beyond the image nothing is set. So with a circle
/// it stays if its centre is farther than the radius from the centre of the nearest pixel that is not set.
/// cost  O(rows of the reach x changes), nothing is expanded
void erode(const RunsView& image, const Reach& reach, Runs& result);

}  // namespace lamina::dose
