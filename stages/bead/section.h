// stages/bead/section.h: the width of a bead of given cross-section.
//
// Three forms, none with a constant of its own:
// - A bead that fills its layer is a stadium: a rectangle with half circles at both sides (the `Flow` of PrusaSlicer and
// Slic3r).
// - A bead that filled its layer and is starved by the lag, though it is fed enough, stays between nozzle and layer below: it
//   keeps its height and is an ellipse. Examples are the thin segments of Di Nisio 2022, Table 11.
// - A thread that is fed too little to fill its layer detaches and stays round, as it left the nozzle, until the layer is
//   filled again. Examples are those of Table 12.
// The rule that separates the last two was derived from Tables 11 and 12, in both of which a bead has half of its area
// and is 0.21 mm wide in one, 0.27 mm in the other. Tables 13 to 16 were not used for it.
#pragma once

#include <algorithm>
#include <numbers>

#include "stages/geometry/bead_section.h"

namespace lamina::bead {

/// mm2: the circle as high as the layer.
inline double full_circle(double height_mm) { return std::numbers::pi / 4 * height_mm * height_mm; }

/// What is fed is enough to fill the layer: a bead that is starved all the same stays between nozzle and layer.
inline bool may_stay_pressed(double fed_mm2, double height_mm) { return fed_mm2 >= full_circle(height_mm); }

/// Whether a bead lies between nozzle and layer. before  whether it did so just before
inline bool stays_pressed(double area_mm2, double fed_mm2, bool before, double height_mm) {
  return area_mm2 >= full_circle(height_mm) || (before && may_stay_pressed(fed_mm2, height_mm));
}

/// mm. pressed  it stays between nozzle and layer; says nothing where the layer is filled
inline double width_of(double area_mm2, bool pressed, double height_mm) {
  const bool ellipse = pressed && area_mm2 < full_circle(height_mm);
  return bead_width(std::max(area_mm2, 0.0), height_mm, ellipse ? BeadShape::kEllipse : BeadShape::kStadium);
}

}  // namespace lamina::bead
