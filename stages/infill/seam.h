// stages/infill/seam.h: where the bead of a wall begins and ends, which leaves a mark.
#pragma once

#include <cstddef>
#include <span>

#include "stages/data/contours.h"
#include "stages/infill/settings.h"

namespace lamina::infill {

/// The point of a closed contour where its bead begins. A function of the contour and of `from` alone, so that layers can be
/// filled in any order: layers whose contours have a corner in common begin there.
///
/// - contour  its first point, as it was sliced
/// - aligned  a corner of 30 degrees or more: of those into the part one, else of those out of it; of several, or of none, the
///            rear one
/// - rear     the one with the largest y; of several the right one
/// - nearest  the nearest one to `from`, where the bead before ended
///
/// contour  solid on the left, at least one point
/// cost     O(points)
std::size_t seam_point(std::span<const Point2> contour, Seam seam, Point2 from);

}  // namespace lamina::infill
