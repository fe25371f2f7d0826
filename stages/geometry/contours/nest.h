// stages/geometry/contours/nest.h: which contours bound the solid, and on which side.
#pragma once

#include "stages/data/buffer.h"
#include "stages/data/choices.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina {

/// Contours of any orientation and nesting become clean: those with solid, by the fill rule, on both sides or on none
/// are dropped, the others are turned so that it lies on their left. Only those that are in contact with others or with
/// themselves go through a boolean operation, group by group: what lies around a group winds the same about all of it.
///
/// group    of each contour, from find_contacts; empty if there is no contact at all
/// returns  number of merged groups
/// errors   kInternal of the clipping library
/// cost     O(P) and, for C contours, C log C and the points of the contours whose boxes lie around each
Result<std::uint32_t> nest(Contours& contours, FillRule rule, const Buffer<std::uint32_t>& group);

/// Whether each of `others` turns as the contour of its number does, and all the rest wind as often about it.
/// contours  clean
/// cost      as nest
bool same_nesting(const Contours& contours, const Contours& others);

// --- clean contours in the order in which formats with regions want them.

/// Puts behind each outer contour the holes in it: those for which it is the innermost outer contour around them. Outer
/// contours, and the holes of one, keep their order; no point moves within its contour.
///
/// contours  clean but for this order
/// cost      O(P) where there are no holes or one outer contour; else, for each hole, the points of the outer contours
///           whose boxes lie around it
void order_by_outer(Contours& contours);

/// Whether they are in that order, checked with one point of each hole. Boolean operations of contours that share edges may
/// leave spikes, or a hole after an outer contour next to it.
/// cost  O(P), and for each hole the points of the outer contour before it
bool is_ordered_by_outer(const ContoursView& contours);

}  // namespace lamina
