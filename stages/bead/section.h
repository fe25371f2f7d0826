// stages/bead/section.h: how wide a bead of a cross-section is.
//
// Three forms, none with a constant of its own:
// - A bead that fills its layer is a stadium: a rectangle with half circles at both sides (the `Flow` of PrusaSlicer and
// Slic3r).
// - A bead that is fed enough to fill its layer, but is starved by the lag, stays between nozzle and layer below: it keeps its
//   height and is an ellipse. Such are the thin stretches of Di Nisio 2022, Table 11.
// - A thread that is fed too little to fill its layer lies as it left the nozzle: it is round. Such are those of Table 12.
// Which of the last two holds is decided by the feed. That rule was found by looking at Tables 11 and 12, in both of which a
// bead has half of its area, 0.21 mm wide in one and 0.27 mm in the other; Tables 13 to 16 had no say in it.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace lamina::bead {

/// mm2: the circle as high as the layer.
inline double full_circle(double height_mm) { return std::numbers::pi / 4 * height_mm * height_mm; }

/// mm. area  mm2 that lie there; fed  mm2 that are fed there
inline double width_of(double area_mm2, double fed_mm2, double height_mm) {
  const double circle = full_circle(height_mm);
  if (area_mm2 >= circle) return height_mm + (area_mm2 - circle) / height_mm;
  if (fed_mm2 >= circle) return height_mm * std::max(area_mm2, 0.0) / circle;
  return height_mm * std::sqrt(std::max(area_mm2, 0.0) / circle);
}

/// The cross-section of a stadium, or of a circle where it is no wider than high.
inline double area_of(double width_mm, double height_mm) {
  if (width_mm <= height_mm) return std::numbers::pi / 4 * width_mm * width_mm;
  return full_circle(height_mm) + (width_mm - height_mm) * height_mm;
}

}  // namespace lamina::bead
