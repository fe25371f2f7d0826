// pipeline/pores/design.h: the job of segmented lines whose pores are as requested, the same everywhere or changing with
// height; as a job file, as text and as JSON.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/pores/forward_run.h"
#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/segment/design.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

struct DesignRequest {
  std::string machine;  // as --machine takes it
  segment::PoreTarget target;
  double tolerance = 0.05;  // of the forward run's result for each target, relative
  std::uint32_t max_runs = 20;
  ForwardGrid grid;
  double near = 0.04;                   // a run that misses the target by so little ends the search
  segment::SlotRatio ratio{1, 0.85};    // as most plans have it: where the search begins
  std::vector<segment::RatioAt> known;  // of forward runs with the same machine and grid
  segment::LineBounds lines;
  std::vector<segment::Reach> reach;  // of reachable(); empty: unknown
  bool nearest = true;                // false: the first region of a gradient that is clearly missed ends the search
};

struct DesignedJob {
  segment::Design design;  // as the corrected model says
  ForwardRun forward;      // of this design
  double miss = 0;         // of the target that the forward run misses by most: relative
  bool met = false;        // within the tolerance
  std::uint32_t runs = 0;
  std::vector<segment::RatioAt> known;  // what forward runs said, of earlier searches too
  double model_ratio = 1;               // k1 of the forward run / of the slots alone
  std::vector<std::string> outside;     // what of the choice lies beyond what was measured, one line each
  std::string widths;                   // where the widths of beads come from
  std::vector<Warning> warnings;        // of the printer: it has no calibration of its own
  std::string toml;                     // of the job file
};

/// The printer, if pores are designed for it. errors  kUsage, of --machine
Result<ExtruderProfile> designable_extruder(const std::string& machine);

/// What the machine reaches with 1, 2, .. continuous lines: porosity by what is fed, k1 of slots, corrected by forward runs in
/// coarse voxels of the tightest and the widest plan.
/// errors  as of design_job()
/// cost    of two forward runs with voxels of 20 um
Result<std::vector<segment::Reach>> reachable(const std::string& machine, const std::function<bool(double)>& advance);
/// A table, with a line if the target is out of it.
std::string as_text(const std::vector<segment::Reach>& reach, bool outside);
Json as_json(const std::vector<segment::Reach>& reach);

/// Searches by slots (segment/design.h), runs the plan forward, corrects the slots by what that says, and searches again
/// until every target is met, or the corrected slots show that none within the machine's limits meets them. A few
/// runs are enough for a target out of the request's reach.
/// returns  the best forward run, even if it misses the target
/// advance  receives the progress, 0 .. 1; false stops
/// errors   kUsage: no such machine, or no calibration of segmented lines; of run_forward(); kInterrupted
/// cost     of up to max_runs forward runs
Result<DesignedJob> design_job(const DesignRequest& request, const std::function<bool(double)>& advance);

struct GradientStep {
  segment::TargetStep step;
  DesignedJob found;  // its forward run, miss and met are of the one file of all regions
};

struct GradientJob {
  std::vector<GradientStep> steps;  // from the bottom up; without toml only those searched until one was missed
  double miss = 0;                  // of the step that misses its target by most
  bool met = false;                 // all of them
  std::uint32_t lines = 0;          // continuous ones in all regions; 0: not the same ones
  std::uint32_t runs = 0;           // forward runs, of the one file one for each region
  double porosity = 0;              // mean over the height
  double permeability_m2 = 0;       // along z, regions in series; what is lost where they meet is left out
  std::string toml;                 // of the job file: ranges of heights
};

/// Designs each step as design_job() does, with the slots found in the runs of the steps below, writes one job with a range
/// of heights for each, plans a block as high as all of them with it, and analyses one period in the middle of each region of
/// that one file.
/// request  its target is ignored
/// steps    of segment::steps_of(), in whole layers of the machine's calibration
/// returns  the nearest of steps that cannot be met
/// errors   those of design_job() and run_forward()
/// cost     of design_job() for each step, and of a forward run for each
Result<GradientJob> design_gradient(const DesignRequest& request, const std::vector<segment::TargetStep>& steps,
                                    const std::function<bool(double)>& advance);

/// What a forward run says: "porosity 24.13 %, k1 101.9 D along z (78.9 to 150), pores 0.071 x 1.61 mm"
std::string predicted_lines(const ForwardRun& forward);

/// Lines that end with LF.
std::string as_text(const DesignedJob& found);
/// output  the job file; "" if none was written
Json as_json(const DesignedJob& found, const std::string& output);

/// The same, step by step from the bottom up.
std::string as_text(const GradientJob& found);
Json as_json(const GradientJob& found, const std::string& output);

/// The nearest values to the targets, as options: "--porosity 26.14".
std::string nearest_text(const segment::PoreTarget& target, const DesignedJob& found);

/// Which steps miss their target, and what is nearest to the first of them; one line.
std::string missed_text(const GradientJob& found);

}  // namespace lamina::pipeline
