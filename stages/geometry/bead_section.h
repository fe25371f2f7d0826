// stages/geometry/bead_section.h: the cross-section of a bead that is deposited on a layer, in mm.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/data/extruder.h"

namespace lamina {

/// mm2. A stadium no wider than it is high is round, with its width as the diameter.
inline double bead_area(double width, double height, BeadShape shape = BeadShape::kStadium) {
  constexpr double kCircle = std::numbers::pi / 4;
  if (shape == BeadShape::kRectangle) return width * height;
  if (shape == BeadShape::kEllipse) return kCircle * width * height;
  if (width <= height) return kCircle * width * width;
  return height * (width - height) + kCircle * height * height;
}

/// The width of a bead of that cross-section; the inverse of bead_area().
inline double bead_width(double area, double height, BeadShape shape = BeadShape::kStadium) {
  constexpr double kCircle = std::numbers::pi / 4;
  if (shape == BeadShape::kRectangle) return area / height;
  if (shape == BeadShape::kEllipse) return area / (kCircle * height);
  if (area <= kCircle * height * height) return std::sqrt(std::max(area, 0.0) / kCircle);
  return area / height + height * (1 - kCircle);
}

}  // namespace lamina
