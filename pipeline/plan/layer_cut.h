// pipeline/plan/layer_cut.h: the segmentation of a job, applied to a part in a layer.
#pragma once

#include "pipeline/plan/sections.h"
#include "pipeline/plan/segment.h"
#include "stages/infill/parameters.h"
#include "stages/segment/layer_cut.h"

namespace lamina::pipeline {

/// How the lines of a part in a layer are cut.
/// errors  of infill::first_place
Result<segment::LayerCut> layer_cut(const SegmentRange& range, const infill::FillParameters& filling, const Layer& layer,
                                    const Box& part);

/// Whether thin stretches fit into the parts at all. errors  kUsage: longer than any line can be
Status check_thin_stretches(const SegmentPlan& segments, const Sections& plan);

}  // namespace lamina::pipeline
