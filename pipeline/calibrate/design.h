// pipeline/calibrate/design.h: the job of segmented lines whose pores are as wished.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/calibrate/forward_run.h"
#include "stages/data/status.h"
#include "stages/segment/design/search.h"

namespace lamina::pipeline {

struct DesignRequest {
  std::string machine;  // as --machine takes it
  segment::PoreWish wish;
  double tolerance = 0.05;  // of what the forward run says of each wish, relative
  std::uint32_t most_runs = 20;
  ForwardGrid grid;
};

struct DesignedJob {
  segment::Design design;  // as the corrected model says
  ForwardRun forward;      // of this design
  double miss = 0;         // of the wish that the forward run meets worst: relative
  bool met = false;        // within the tolerance
  std::uint32_t runs = 0;
  double model_ratio = 1;            // k1 of the forward run / of the slots alone
  std::vector<std::string> outside;  // what of the choice lies beyond what was measured, one line each
  std::string widths;                // where the widths of beads come from
  std::string toml;                  // of the job file
};

/// Searches by slots (segment/design/slots.h), runs the plan forward, corrects the slots by what that says, and searches again
/// until every wish is met, or the corrected slots say that none within the machine's limits meets them.
/// returns  the best that was run forward, whether it meets the wish or not
/// tell     is told how far it is, 0 .. 1; false stops
/// errors   kUsage: no such machine, or no calibration of segmented lines; of run_forward(); kInterrupted
/// cost     of up to most_runs forward runs
Result<DesignedJob> design_job(const DesignRequest& request, const std::function<bool(double)>& tell);

}  // namespace lamina::pipeline
