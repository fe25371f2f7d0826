// stages/infill/fill.h: contours of one body in one layer -> the beads that fill it.
//
//   contours ─> walls ─> region of bead centres ─> raster | closed curves | waves ─> toolpaths
//
// A pure function of its arguments: nothing is kept from layer to layer, so layers can be filled in any order and by
// any number of threads.
#pragma once

#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/gaps.h"
#include "stages/infill/parameters.h"

namespace lamina::infill {

/// Whether the parameters can fill anything at all; what one layer's heights make of them is checked there.
/// errors  kUsage, one line that names what is wrong
Status check(const FillParameters& parameters);

/// Where the centres of beads are, or may be: all deposited lines are made of these alone.
struct Outlines {
  std::vector<Contours> walls;  // from the surface inwards; one that would hold nothing ends them
  Contours region;              // of filling beads: the contours moved inwards past the walls; nothing for kNone
  // --- by density: all inside the walls is `region`, whose sparse lines end at its edge, or `solid`
  Contours solid, solid_centres;  // the latter: of its lines
  GapLines thin_walls;            // where the part is thinner than a bead
  Contours gaps;                  // between walls, narrower than a bead
  // --- of any filling
  Contours lost;  // features of the part without a bead, since they are thinner than any

  std::uint64_t bytes() const {
    const auto of = [](const Contours& c) { return bytes_held(c.point) + bytes_held(c.offset); };
    std::uint64_t sum = of(region) + of(solid) + of(solid_centres) + thin_walls.bytes() + of(gaps) + of(lost);
    for (const Contours& wall : walls) sum += of(wall);
    return sum;
  }
};

/// Each outline is the one before moved inwards, which is the contours moved so far; then ends of edges shorter than 0.05 mm
/// are merged where that moves it by no more than the tolerance of the context.
/// contours  clean, of one body
/// errors    kUsage: a distance between lines that is not positive, a formula that fails; kInternal of Clipper
Result<Outlines> outlines_of(const ContoursView& contours, const FillContext& context, const FillParameters& parameters);

/// Appends walls, then the filling. errors  as outlines_of
Status append_fill(Outlines outlines, const FillContext& context, const FillParameters& parameters, Toolpaths& out);

/// What append_fill may come to, counted before anything is deposited: lines are placed and their crossings with the region
/// counted, curves counted by their positions and what the region is like at some of these, waves by what of them is within
/// reach of the region.
struct FillBound {
  std::uint64_t points = 0;  // of toolpaths
  std::uint64_t paths = 0;
  std::uint64_t intervals = 0;      // of one kind each, into which files divide paths
  std::uint64_t scratch_bytes = 0;  // while they are made
};
/// errors  as outlines_of
/// cost    O(P log L) for P points of the region and L lines; of curves, an eighth of the cost of append_fill
Result<FillBound> bound_fill(const ContoursView& contours, const Outlines& outlines, const FillContext& context,
                             const FillParameters& parameters);

}  // namespace lamina::infill
