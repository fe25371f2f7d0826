// stages/infill/raft.h: layers under the parts, of which the first sticks to the bed and the last carries the parts.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/data/toolpaths.h"
#include "stages/infill/parameters.h"

namespace lamina::infill {

/// The region of all raft layers: what the outer contours of the parts' first layer enclose, grown, within the bed.
///
/// layer   clean contours of all parts
/// margin  nm beyond the parts
/// bed     nm, from 0
/// errors  kInternal of Clipper
Result<Contours> raft_region(const ContoursView& layer, Nm margin, std::array<std::int64_t, 2> bed);

/// The beads of a raft layer: a wall around lines whose direction changes by 90 degrees from layer to layer. The first layer is
/// at 90 %, as in PrusaSlicer (raft_first_layer_density); the last of several is solid; those between are at 50 %.
///
/// layer   with its number in the raft, from 0
/// layers  of the raft
/// own     shape, width and nominal thickness of beads
/// errors  of append_fill
Status append_raft(const ContoursView& region, const Layer& layer, std::uint32_t layers, const FillParameters& own,
                   Toolpaths& out);

}  // namespace lamina::infill
