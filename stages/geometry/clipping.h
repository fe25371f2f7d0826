// stages/geometry/clipping.h: unions and offsets of contours, on Clipper's integers.
//
// The library is A. Johnson's Clipper 6.4.2 (Debian's polyclipping), which works on whole numbers: corners of the
// operands stay where they are, new corners are rounded to the nearest nm.
#pragma once

#include "stages/data/choices.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"

namespace lamina {

/// How the corners of an offset that open outwards are made.
enum class OffsetJoin : std::uint8_t {
  kMiter,  // sharp, up to twice the distance from the corner, then cut off
  kRound   // an arc, off by at most 1 micrometre
};

/// The region that `contours`, of any orientation and overlap, mean by `rule`, as clean contours, each outer one
/// followed by its holes.
/// errors  kInternal if Clipper refuses the contours
/// cost    O((P + X) log P) for P points and X crossings
Result<Contours> contour_union(const ContoursView& contours, FillRule rule);

/// The region that curves, which may cross themselves, go round counter-clockwise more often than clockwise. As contour_union
/// in less time, but contours of the result may touch at corners.
Result<Contours> curve_union(const ContoursView& curves);

/// The region of clean contours less that of others, which may overlap each other: where they share an edge nothing is
/// left of it. In the order of contour_union.
/// errors  kInternal if Clipper refuses them
Result<Contours> subtract_contours(const ContoursView& contours, const ContoursView& less);

/// The region that two sets of clean contours share. As subtract_contours.
Result<Contours> intersect_contours(const ContoursView& one, const ContoursView& other);

/// The region of clean contours grown by `distance` nm, shrunk where it is negative, as clean contours; pieces that
/// shrink away are gone. Contours keep their distance to within 1 nm of rounding where they are straight.
/// errors  kInternal if Clipper refuses the contours
Result<Contours> offset_contours(const ContoursView& contours, std::int64_t distance, OffsetJoin join = OffsetJoin::kMiter);

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
