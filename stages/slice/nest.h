// stages/slice/nest.h: which contours bound the solid, and on which side.
#pragma once

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/fill_rule.h"

namespace lamina::slice {

/// Contours that keep clear of each other (contact.h), of any orientation and nesting, become clean: those with solid,
/// by the fill rule, on both sides or on none are dropped, the others are turned so that it lies on their left.
/// cost  O(P) and, for C contours, C log C and the points of the contours whose boxes lie around each
void nest(Contours& contours, FillRule rule);

}  // namespace lamina::slice
