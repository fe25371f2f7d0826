// stages/infill/raster.h: parallel lines across a region, joined to a zigzag where they can be.
//
// A line crosses an edge of the region's contours if exactly one end of the edge has v <= line, as rows cross segments
// in the bitmaps; so corners and edges on a line count once. Crossings are ordered exactly, and a line's ends are
// rounded to the nm inside the region.
//
// The end of a line is linked to the start of the next by walking along the contour from one crossing to the other. A
// link exists if that walk comes to the next line first and is not too long. It lies on the region's edge, so it leaves
// the region nowhere, whatever its shape.
#pragma once

#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/frame.h"
#include "stages/infill/spacing.h"

namespace lamina::infill {

struct RasterOptions {
  Nm width = 0;
  std::int64_t longest_link = 0;  // nm along the contour; 0: none
  Nm shortest_line = 0;
};

/// How often `places` cross the edges of `region`, both in the frame.
std::uint64_t count_crossings(const ContoursView& region, const LinePositions& positions);

/// Appends the lines of `places` (nm across the lines, in the frame) within `region`, turned back to the bed.
///
/// region   clean contours, already turned into the frame
/// returns  paths in the order of their first lines; even lines run towards +u (-u in a reversed frame), odd ones back
/// cost     O(P + X log X) for P points and X crossings, count, scan, fill; no allocation for a line
void append_raster(const ContoursView& region, const LinePositions& positions, const Frame& frame, const RasterOptions& options,
                   Toolpaths& out);

}  // namespace lamina::infill
