// stages/segment/bead.h: the cross-section of a bead that is laid on a layer, in mm.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::segment {

/// kRoundedRectangle is what PrusaSlicer and Slic3r take (their `Flow`): a rectangle with half circles at both sides.
/// kEllipse has the same width and height and is narrower at the bottom.
enum class BeadShape { kRoundedRectangle, kEllipse, kRectangle };

/// mm2. A bead no wider than it is high is taken as a round one with its width as the diameter.
inline double bead_area(double width, double height, BeadShape shape = BeadShape::kRoundedRectangle) {
  constexpr double kCircle = std::numbers::pi / 4;
  if (shape == BeadShape::kRectangle) return width * height;
  if (shape == BeadShape::kEllipse) return kCircle * width * height;
  if (width <= height) return kCircle * width * width;
  return height * (width - height) + kCircle * height * height;
}

/// The width of a bead of that cross-section; the inverse of bead_area().
inline double bead_width(double area, double height, BeadShape shape = BeadShape::kRoundedRectangle) {
  constexpr double kCircle = std::numbers::pi / 4;
  if (shape == BeadShape::kRectangle) return area / height;
  if (shape == BeadShape::kEllipse) return area / (kCircle * height);
  if (area <= kCircle * height * height) return std::sqrt(std::max(area, 0.0) / kCircle);
  return area / height + height * (1 - kCircle);
}

}  // namespace lamina::segment
