// pipeline/plan/fill.h: the filling of a part at each height, from section [fill] of a job.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/job/job.h"
#include "stages/data/status.h"
#include "stages/infill/parameters.h"

namespace lamina::pipeline {

/// The filling of a part at each height.
struct FillPlan {
  struct FillInterval {
    std::int64_t from, to;  // nm above the part's bottom: layers whose middle is in [from, to)
    infill::FillParameters parameters;
  };
  infill::FillParameters base;
  std::vector<FillInterval> ranges;  // in order, disjoint

  const infill::FillParameters& at(std::int64_t height) const;
  /// Whether any layer has walls or a filling.
  bool fills() const;
};

/// The plan of a part, from the job's section and the part's changes.
/// errors  kUsage, one line that begins with the key
Result<FillPlan> plan_filling(const FillRequest& request, const FillChanges& part_changes);

}  // namespace lamina::pipeline
