// pipeline/run/job_cost.h: what a job of a powder printer uses up and costs, layer by layer.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/plan/plan.h"
#include "pipeline/run/summary.h"
#include "stages/cost/cost.h"
#include "stages/cost/part_pixels.h"
#include "stages/write/manifest/record.h"

namespace lamina::pipeline {

/// Of a plan with a machine, which outlives it. Parts are told apart where there are several and anything has a price.
class JobCost {
 public:
  explicit JobCost(const Plan& plan);

  /// Counts the pixels of each part in a layer's image. From many threads at once.
  void count(const RunsView& image, LayerRecord& record) const;
  /// From one thread at a time.
  void add(const LayerRecord& record);
  /// Its lines and facts.
  void tell(Summary& summary) const;

 private:
  const Machine& machine_;
  std::vector<std::string> names_;
  cost::Tally tally_;
  std::optional<cost::PartPixels> windows_;
};

}  // namespace lamina::pipeline
