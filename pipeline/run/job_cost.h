// pipeline/run/job_cost.h: what a job of a powder printer uses up and costs, layer by layer.
#pragma once

#include <optional>

#include "pipeline/plan/plan.h"
#include "stages/cost/account.h"
#include "stages/cost/part_pixels.h"
#include "stages/write/manifest/manifest.h"

namespace lamina::pipeline {

/// Of a job with a machine.
class JobCost {
 public:
  /// Parts are told apart where there are several, and anything has a price or their table is wanted.
  explicit JobCost(const Plan& plan);
  /// Of a finished job, whose parts are told apart if its layers say what is whose.
  JobCost(const Machine& machine, const Manifest& manifest);

  /// Counts the pixels of each part in a layer, and its drops where a saturation decides them. From many threads at once.
  void count(const RunsView& image, const dose::DropWork& drops, LayerRecord& record) const;
  /// From one thread at a time. drops, microseconds  of its print program, with the drops that are spat
  void add(const LayerRecord& record, std::uint64_t drops, std::int64_t microseconds);
  const cost::Account& account() const { return account_; }

 private:
  cost::Account account_;
  std::optional<cost::PartPixels> windows_;
  bool saturates_ = false, several_ = false;  // drops are decided; pixels get more than one
  std::uint8_t full_ = 0;                     // level of a full voxel; 0: pixels are set or not
};

}  // namespace lamina::pipeline
