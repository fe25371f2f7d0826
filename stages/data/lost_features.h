// stages/data/lost_features.h: features of a layer that get no bead.
#pragma once

#include "stages/data/contours.h"

namespace lamina {

/// Thinner than any bead.
struct LostFeatures {
  double area_mm2 = 0;
  Point2 at{};  // in the first one, nm on the bed
};

}  // namespace lamina
