// pipeline/run/around_parts.h: what is deposited before the parts: skirt and brim in their first layer, a raft under it.
#pragma once

#include <vector>

#include "pipeline/output/toolpath_file.h"
#include "pipeline/plan/plan.h"
#include "pipeline/run/progress_estimate.h"
#include "stages/data/contours.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/formats/extrusion_format.h"

namespace lamina::pipeline {

/// Adds the skirt and the brim to the first layer; with a raft nothing, which has its own skirt. The first layer of a job that
/// begins at the bed has a skirt, with beads or not. contours  of all parts. errors  kInternal of Clipper
Status deposit_around(const Plan& plan, const Layer& layer, const ContoursView& contours, formats::LayerMoves& out);

/// Appends the text of the raft's layers; nothing without a raft.
///
/// contours  of all parts in their first layer
/// progress  at the start of each
/// returns   the sums over each of them, with the travel to it
/// errors    kInternal of Clipper
Result<std::vector<formats::MoveTotals>> append_raft(const Plan& plan, const ToolpathFile& file, const ContoursView& contours,
                                                     const ProgressEstimate& progress, Buffer<char>& text);

}  // namespace lamina::pipeline
