// stages/geometry/coverage.h: runs made smaller for the eye.
#pragma once

#include <cstdint>
#include <span>

#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/geometry/bits.h"

namespace lamina {

/// Columns [left, right) and rows [top, bottom) of an image; empty if left == right.
struct PixelWindow {
  std::uint32_t left = 0, right = 0, top = 0, bottom = 0;

  std::uint32_t width() const { return right - left; }
  std::uint32_t height() const { return bottom - top; }
  bool empty() const { return left >= right || top >= bottom; }
};

/// The smallest window that holds all set pixels; empty if there is none. Cost: the first and last change of each row.
PixelWindow window_of(RowRuns image);
PixelWindow window_of(const LevelsView& levels);

/// The smallest window that holds both.
PixelWindow joined(const PixelWindow& one, const PixelWindow& other);

/// How much of each of columns x rows equal parts of the window is set: 0 none ... 255 all, to the nearest.
/// The share is that of the area (a box filter), found from the runs in integers: no pixel of the full size is
/// read. Parts may be smaller than pixels.
/// window   not empty, within the image
/// columns  1 .. 65535; result  columns x rows values, the top row first
/// cost     a few operations a run and result row that it touches, and one a result value
void box_coverage(RowRuns image, const PixelWindow& window, std::uint32_t columns, std::span<std::uint8_t> result);

/// The same of drops, the planes of which are added up: 255 where all pixels get `full` drops. cost  that of each plane
void box_coverage(std::span<const BitRows* const> planes, std::uint32_t full, const PixelWindow& window, std::uint32_t columns,
                  std::span<std::uint8_t> result);

/// The same of levels, each pixel set by its share: 255 where all have the level `full` (no pixel has more), and the mean of
/// shares where they differ. Of one level it is what the runs are.
void box_coverage(const LevelsView& levels, std::uint8_t full, const PixelWindow& window, std::uint32_t columns,
                  std::span<std::uint8_t> result);

}  // namespace lamina
