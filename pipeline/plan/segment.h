// pipeline/plan/segment.h: the segmentation of lines at each height, from section [segment] of a job, and its cut of a layer.
#pragma once

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/sections.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/infill/parameters.h"
#include "stages/segment/calibration.h"
#include "stages/segment/cut.h"
#include "stages/segment/segmentation.h"

namespace lamina::pipeline {

/// Resolved segmentation of a range of heights.
struct SegmentRange {
  std::int64_t from = 0, to = INT64_MAX;  // nm above the part's bottom: layers whose middle is in [from, to)
  SegmentSettings settings;
  segment::Segmentation plan;
};

/// The segmentation at each height.
struct SegmentPlan {
  SegmentRange base;
  std::vector<SegmentRange> ranges;  // in order, disjoint

  const SegmentRange& at(std::int64_t height) const;
  bool any() const;
  bool crosses() const;  // whether pores of layers are to lie over each other
  /// Ranges with segmented lines, by heights: "3 to 5.7 mm", "" for the base.
  std::vector<std::pair<std::string, const SegmentRange*>> segmented() const;
};

/// Makes the plan and completes `fill`: line distances derived from the plan unless given, and lines where it has none.
/// errors   kUsage, one line that begins with the key
Result<SegmentPlan> plan_segments(const SegmentRequest& request, const segment::Calibration& calibration, FillRequest& fill);

/// Warnings before any toolpath is deposited: `no-bead`, `pores`, `calibration`. fills  walls or lines are requested
void warn_of_segments(const SegmentPlan& segments, const ExtruderProfile& profile, bool fills, std::vector<Warning>& warnings);

/// The cut of a part's lines in a layer.
/// errors  of infill::first_position
Result<segment::LayerCut> layer_cut(const SegmentRange& range, const infill::FillParameters& filling, const Layer& layer,
                                    const Box& part);

/// Checks that thin stretches fit into the parts. errors  kUsage: longer than any possible line
Status check_thin_intervals(const SegmentPlan& segments, const Sections& plan);

}  // namespace lamina::pipeline
