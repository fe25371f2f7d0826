// stages/geometry/contours/order.h: clean contours in the order in which formats with regions want them.
#pragma once

#include "stages/data/contours.h"

namespace lamina {

/// Puts behind each outer contour the holes in it: those for which it is the innermost outer contour around them. Outer
/// contours, and the holes of one, keep their order; no point moves within its contour.
///
/// contours  clean but for this order
/// cost      O(P) where there are no holes or one outer contour; else, for each hole, the points of the outer contours
///           whose boxes lie around it
void order_by_outer(Contours& contours);

}  // namespace lamina
