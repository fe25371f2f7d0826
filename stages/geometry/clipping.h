// stages/geometry/clipping.h: unions and offsets of contours, on Clipper's integers.
//
// The library is A. Johnson's Clipper 6.4.2 (Debian's polyclipping), which works on whole numbers: corners of the
// operands stay where they are, new corners are rounded to the nearest nm.
#pragma once

#include "stages/data/choices.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina {

/// The region that `contours`, of any orientation and overlap, mean by `rule`, as clean contours, each outer one
/// followed by its holes.
/// errors  kInternal if Clipper refuses the contours
/// cost    O((P + X) log P) for P points and X crossings
/// simple   false: contours of the result may touch at corners; true costs the square of the points of a contour
Result<Contours> contour_union(const ContoursView& contours, FillRule rule, bool simple = true);

/// The region of clean contours less that of others, which may overlap each other: where they share an edge nothing is
/// left of it. In the order of contour_union.
/// errors  kInternal if Clipper refuses them
/// simple  as contour_union
Result<Contours> subtract_contours(const ContoursView& contours, const ContoursView& less, bool simple = true);

/// The region that two sets of clean contours share. As subtract_contours.
Result<Contours> intersect_contours(const ContoursView& one, const ContoursView& other, bool simple = true);

/// The region of clean contours grown by `distance` nm, shrunk where it is negative, as clean contours, each outer one followed
/// by its holes; pieces that shrink away are gone. Straight edges keep their distance to within 1 nm of rounding. Corners that
/// open are sharp up to twice the distance from the corner, and beyond cut off square at the distance.
///
/// contours  each outer one followed by the holes in it
/// errors    kInternal if Clipper refuses them
/// cost      O(P) for P points where no edge vanishes; else O((P + X) log P) for an outer contour and its holes, X crossings
Result<Contours> offset_contours(const ContoursView& contours, std::int64_t distance);

/// The pieces of open lines that lie within clean contours, in any order and direction.
/// lines   each of two points or more; not closed
/// errors  kInternal if Clipper refuses them
Result<Contours> clip_lines(const ContoursView& lines, const ContoursView& region);

/// The area that beads along open lines cover, round at their ends and turns to within a micrometre; for pictures and
/// for the contours of beads.
/// width   nm of the bead
/// errors  kInternal if Clipper refuses them
Result<Contours> cover_lines(const ContoursView& lines, Nm width);

}  // namespace lamina
