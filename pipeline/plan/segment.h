// pipeline/plan/segment.h: which lines are segmented at each height, decided from [segment] of a job.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/job/fill.h"
#include "pipeline/job/job.h"
#include "stages/data/status.h"
#include "stages/segment/calibration.h"
#include "stages/segment/expand.h"
#include "stages/segment/predict.h"

namespace lamina::pipeline {

/// Segmentation of a range of heights, resolved.
struct SegmentRange {
  std::int64_t from = 0, to = INT64_MAX;  // nm above the part's bottom: layers whose middle is in [from, to)
  SegmentSettings settings;
  segment::Segmentation plan;
};

/// What is segmented at each height, and the fillings that this asks for.
struct SegmentPlan {
  SegmentRange base;
  std::vector<SegmentRange> ranges;  // in order, none overlaps another

  const SegmentRange& at(std::int64_t height) const;
  bool any() const;
};

/// The plan; `fill` gets the distances between lines that follow from it, unless it gives them, and lines where it has none.
/// errors   kUsage, one line that begins with the key
Result<SegmentPlan> plan_segments(const SegmentRequest& request, const segment::Calibration& calibration, FillRequest& fill);

}  // namespace lamina::pipeline
