// stages/infill/lines.h: open lines across a region: straight ones, joined to a zigzag where they can be, and waves.
//
// A line crosses an edge of the region's contours if exactly one end of the edge has v <= line, as rows cross segments
// in the bitmaps; so corners and edges on a line count once. Crossings are ordered exactly, and a line's ends are
// rounded to the nm inside the region.
//
// The end of a line is linked to the start of the next by walking along the contour from one crossing to the other. A
// link exists if that walk comes to the next line first and is not too long. It is on the region's edge, so it leaves
// the region nowhere, regardless of its shape.
#pragma once

#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/layout.h"

namespace lamina::infill {

/// How often the lines cross the edges of `region`, both in the frame.
std::uint64_t count_crossings(const ContoursView& region, const LinePositions& positions);

/// Appends the lines at `positions` (of positions_across) within `region`, turned back to the bed.
///
/// region   clean contours, already turned into the frame
/// returns  paths in the order of their first lines; even lines run towards +u (-u in a reversed frame), odd ones back
/// cost     O(P + X log X) for P points and X crossings, count, scan, fill; no allocation for a line
void append_raster(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions,
                   const Frame& frame, Toolpaths& out);

// --- lines that are no straight ones: honeycomb and quatrefoil.
//
// Both are waves of period 3a for cells with sides a, neighbours mirrored, so that crests meet crests. A honeycomb's
// waves are trapezoids whose flat crests touch: two beads side by side, as thick as the cells' walls between. A
// quatrefoil's are cosines that stay a gap apart, so that no closed cell forms within a layer; its exact curve is not
// published, only that it is like a honeycomb with its lines kept apart (Entezari et al. 2019, design D, as reported by Di
// Nisio 2022, section 2.5).

inline bool is_wave(Pattern pattern) { return pattern == Pattern::kHoneycomb || pattern == Pattern::kQuatrefoil; }

/// Height of a wave from trough to crest, nm.
Nm wave_height(const FillParameters& parameters);

/// What clipped waves may come to at most: corners of waves within the reach of the region in their strip, and where its
/// edges may cross them.
struct WaveBound {
  std::uint64_t points = 0, pieces = 0;
  std::uint64_t at_once = 0;  // points of the waves that are clipped together, before they are cut at the region's edge
};
/// cost  O(edges x strips that they pass)
WaveBound bound_waves(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions);

/// Appends the waves that lie in `region` (clean contours in the frame), their troughs at `positions`.
/// `start_u` is where crests are counted from. Pieces shorter than shortest_line along u are left out.
/// errors  kUsage: too many cells; kInternal of the clipping library
/// memory  some megabytes in addition to the result: waves are clipped a few at a time
Status append_waves(const ContoursView& region, const FillParameters& parameters, const LinePositions& positions,
                    std::int64_t start_u, const Frame& frame, Toolpaths& out);

}  // namespace lamina::infill
