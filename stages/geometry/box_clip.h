// stages/geometry/box_clip.h: the part of contours in a box, fast and for further boolean operations only.
#pragma once

#include "stages/data/contours.h"

namespace lamina {

/// Appends contours cut off at the sides of a box. Each contour stays one: where it leaves the box several times, edges along
/// the sides join its parts and lie on each other. So contours are not clean, but by nonzero mean the region in the box. New
/// corners are rounded to the nearest nm. cost    O(P) source  I. Sutherland, G. Hodgman, "Reentrant polygon clipping",
/// Communications of the ACM 17 (1974)
void clip_to_box(const ContoursView& contours, Point2 lo, Point2 hi, Contours& out);

}  // namespace lamina
