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

/// Whether they are in that order, as far as one place of each hole tells. Boolean operations of contours that share edges may
/// leave spikes, or a hole behind an outer contour beside it.
/// cost  O(P), and for each hole the points of the outer contour before it
bool is_ordered_by_outer(const ContoursView& contours);

}  // namespace lamina
