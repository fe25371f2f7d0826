// stages/infill/layout.h: where the lines, waves or closed curves of one layer lie, before any is laid.
#pragma once

#include "stages/data/contours.h"
#include "stages/data/status.h"
#include "stages/infill/frame.h"
#include "stages/infill/parameters.h"
#include "stages/infill/spacing.h"

namespace lamina::infill {

/// The frame in which the layer's lines run along +u.
Frame frame_of(const FillContext& context, const FillParameters& parameters);

/// How far inside the surface the region of bead centres begins, nm: past the walls.
/// errors  of line_positions
Result<std::int64_t> region_depth(const FillContext& context, const FillParameters& parameters);

/// Lines of a raster, or troughs of waves, across `region` (in the frame).
/// errors  of line_positions
Result<LinePositions> positions_across(const ContoursView& region, const Frame& frame, const FillContext& context,
                                       const FillParameters& parameters);

/// Closed curves: their depths below the surface, nm, from the first one inwards, as far as any can lie in `region`.
/// The list of distances is the one that lines follow; line 0 is the curve at the region's edge, or first_line deep.
/// errors  of line_positions
Result<LinePositions> positions_inwards(const ContoursView& region, const FillContext& context,
                                        const FillParameters& parameters);

}  // namespace lamina::infill
