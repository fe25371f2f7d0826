// stages/slice/tidy.h: points of contours that say nothing are dropped.
#pragma once

#include "stages/data/contours.h"

namespace lamina::slice {

/// Drops points that lie exactly on the line through their neighbours (spikes that run back on themselves and repeated
/// points among them), then, if tolerance > 0, points whose loss moves the contour by at most that. Contours that have
/// no area left are dropped.
///
/// tolerance  nm; between the points that stay, the contour keeps within it of all that go (straight distance)
/// cost       O(P); with a tolerance O(P log P) as a rule
/// source     D. Douglas, T. Peucker, "Algorithms for the reduction of the number of points required to represent a
///            digitized line or its caricature", Cartographica 10 (1973), between two points far apart of each contour
void tidy(Contours& contours, Nm tolerance);

}  // namespace lamina::slice
