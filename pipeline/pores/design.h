// pipeline/pores/design.h: the job of segmented lines whose pores are as wished.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/pores/forward_run.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/segment/design/designed.h"

namespace lamina::pipeline {

struct DesignRequest {
  std::string machine;  // as --machine takes it
  segment::PoreWish wish;
  double tolerance = 0.05;  // of what the forward run says of each wish, relative
  std::uint32_t most_runs = 20;
  ForwardGrid grid;
  double near = 0.04;                   // a run that misses the wish by so little ends the search
  segment::SlotRatio ratio{1, 0.85};    // as most plans have it: where the search begins
  std::vector<segment::RatioAt> known;  // of forward runs with the same machine and grid
  segment::LineBounds lines;
};

using segment::DesignedJob;

/// The printer, if pores are designed for it. errors  kUsage, of --machine
Result<ExtruderProfile> designable_extruder(const std::string& machine);

/// Searches by slots (segment/design/slots.h), runs the plan forward, corrects the slots by what that says, and searches again
/// until every wish is met, or the corrected slots say that none within the machine's limits meets them.
/// returns  the best that was run forward, whether it meets the wish or not
/// tell     is told how far it is, 0 .. 1; false stops
/// errors   kUsage: no such machine, or no calibration of segmented lines; of run_forward(); kInterrupted
/// cost     of up to most_runs forward runs
Result<DesignedJob> design_job(const DesignRequest& request, const std::function<bool(double)>& tell);

}  // namespace lamina::pipeline
