// stages/infill/gaps.h: beads for what is too narrow for a bead of the set width: gaps between walls, remains of solid regions,
// and walls that are thinner than a bead.
//
//   narrow region ─> centres with a distance from its edge between two half widths ─> one line along each of these strips
//                ─> lines whose ends meet are joined
//
// Half widths fall from the widest to the narrowest by a sixth each, so a line has the width of the region to within a tenth,
// and its bead the volume of the region there. Real medial axes need a Voronoi diagram of the edges; strips of offsets need no
// more than the offsets that walls are made of.
#pragma once

#include <cmath>
#include <cstdint>
#include <initializer_list>

#include "stages/data/contours.h"
#include "stages/data/extruder.h"  // BeadShape
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"

namespace lamina::infill {

/// nm
inline double distance(Point2 a, Point2 b) {
  return std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
}

/// The widths of narrow regions that get a bead, nm.
struct GapWidths {
  Nm maximum;  // wider ones are filled otherwise
  Nm minimum;  // narrower ones stay empty
};

/// Lines along the middle of narrow regions, open or closed (their first point again at the end).
struct GapLines {
  Contours lines;
  Buffer<Nm> gap;  // nm of the region there, of each point: of the line from it to the next one
  Contours left;   // narrower than the minimum, but for specks

  std::uint64_t bytes() const;
};

/// The part of a region that is narrower than twice `half`: the region without all discs (squares in its corners) of that
/// radius within it. Empty if its area is below that of one disc. inset   the region moved inwards by `half` errors  kInternal
/// of Clipper
Result<Contours> narrow_part(const ContoursView& region, const ContoursView& inset, std::int64_t half);

/// The narrowest region that gets a bead: a quarter of the pitch.
constexpr Nm min_gap(double pitch) { return static_cast<Nm>(pitch / 4); }

/// Islands of at most two squares of a bead's width in whose boxes nothing is deposited.
Contours bare_islands(const ContoursView& contours, Nm width, std::initializer_list<const Contours*> deposited);

/// Pieces of what is narrower than `width` that are more than the tip of a corner.
Contours narrow_features(const ContoursView& narrow, Nm width);

/// Adds a line half as long as the root of its area for each island that is wider and deeper than `minimum`, with its area;
/// returns the others.
Contours add_dots(const ContoursView& islands, Nm minimum, GapLines& lines);

/// Upper bound of the points of lines in narrow regions.
std::uint64_t bound_gap_points(const ContoursView& region, const GapWidths& widths);

/// errors  kInternal of Clipper
/// cost    O((P + L / h) log P) of regions with P points and an edge of length L, for widths down to h
Result<GapLines> gap_lines(const ContoursView& narrow, const GapWidths& widths);

/// Appends lines as beads of the volume of their gap. height  mm of the layer
void append_gap_lines(const GapLines& lines, double height_mm, BeadShape shape, PathKind kind, Toolpaths& out);

}  // namespace lamina::infill
