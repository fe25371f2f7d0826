// pipeline/plan/layer_cut.h: applies the segmentation of a job to a part in a layer.
#pragma once

#include "pipeline/plan/sections.h"
#include "pipeline/plan/segment.h"
#include "stages/infill/parameters.h"
#include "stages/segment/layer_cut.h"

namespace lamina::pipeline {

/// The cut of a part's lines in a layer.
/// errors  of infill::first_position
Result<segment::LayerCut> layer_cut(const SegmentRange& range, const infill::FillParameters& filling, const Layer& layer,
                                    const Box& part);

/// Checks that thin stretches fit into the parts. errors  kUsage: longer than any possible line
Status check_thin_intervals(const SegmentPlan& segments, const Sections& plan);

}  // namespace lamina::pipeline
