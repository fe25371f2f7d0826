// stages/geometry/contours/tidy.h: points of contours that say nothing are dropped.
#pragma once

#include "stages/data/contours.h"

namespace lamina {

/// Drops points that lie exactly on the line through their neighbours: spikes that run back on themselves and repeated
/// points among them. Contours that have no area left are dropped.
/// cost  O(P)
void tidy(Contours& contours);

}  // namespace lamina
