#include "pipeline/pores/design.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "stages/segment/design/design_page.h"
#include "stages/segment/design/job_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr double kNoNearer = 0.02;

}  // namespace

Result<ExtruderProfile> designable_extruder(const std::string& machine) {
  auto profile = find_extruder(machine);
  if (!profile) return Error{profile.error().fault, "--machine: " + profile.error().message};
  if (profile->machine.format != "gcode")
    return Error{Fault::kUsage, fmt::format("--machine: {} writes {}; pores are designed for machines of G-code",
                                            one_line(machine), profile->machine.format)};
  // As the job is written: beads as wide as the nozzle, at the speed of the published tables, that short stretches reach.
  Job job;
  job.fill.all.width_mm = profile->machine.material.nozzle_mm;
  job.layer_mm = std::round(job.fill.all.width_mm * 750) / 1000;
  ExtruderProfile slow = *profile;
  slow.machine.speed.print_mm_s = profile->calibration.speed_mm_s;
  predict_calibration(job, slow);
  profile->calibration = slow.calibration;
  profile->predicted_calibration = slow.predicted_calibration;
  return profile;
}

Result<DesignedJob> design_job(const DesignRequest& request, const std::function<bool(double)>& tell) {
  const auto profile = designable_extruder(request.machine);
  if (!profile) return profile.error();
  const Calibration& calibration = profile->calibration;
  const auto limits = segment::DesignLimits::of(profile->machine, calibration);
  if (!limits) return Error{limits.error().fault, fmt::format("--machine {}: {}", request.machine, limits.error().message)};
  std::vector<segment::RatioAt> known = request.known;
  std::vector<std::string> tries;
  std::optional<DesignedJob> best;
  while (tries.size() < request.most_runs) {
    DesignedJob tried;
    tried.design = segment::search(request.wish, *limits, request.ratio, request.lines, known);
    // Out of reach, and no run to come is nearer.
    if (best && tried.design.miss > request.tolerance && tried.design.miss > best->miss - kNoNearer) break;
    tried.toml = segment::designed_job_text(request.machine, *profile, tried.design.settings);
    if (std::ranges::find(tries, tried.toml) != tries.end()) break;
    Job job;
    if (const Status status = read_job_text(tried.toml, "the job", job); !status) return status.error();
    const double done = static_cast<double>(tries.size());
    const auto forward = run_forward(job, request.machine, tried.design.plan, request.grid,
                                     [&](double share) { return tell((done + share) / request.most_runs); });
    if (!forward) return forward.error();
    tries.push_back(tried.toml);
    tried.forward = *forward;
    tried.miss = segment::miss_of(request.wish, *forward);
    tried.met = tried.miss <= request.tolerance;
    tried.outside = segment::outside_of(*limits, tried.design.choice);
    if (profile->predicted_calibration)
      tried.outside.insert(tried.outside.begin(), "nothing was measured on this printer: its widths are the model's");
    // The slots without the ratios of before.
    const segment::Design& design = tried.design;
    const double flow = design.slots.permeability_m2 / design.ratio.permeability;
    const double void_share = design.slots.porosity / design.ratio.porosity;
    tried.model_ratio = flow > 0 ? forward->permeability_m2 / flow : 1;
    if (flow > 0 && void_share > 0 && forward->permeability_m2 > 0 && forward->porosity > 0)
      known.push_back({design.choice, {forward->porosity / void_share, forward->permeability_m2 / flow}});
    if (!best || tried.miss < best->miss) best = std::move(tried);
    if (best->miss <= request.near) break;
  }
  best->runs = static_cast<std::uint32_t>(tries.size());
  best->known = std::move(known);
  best->widths = one_line(calibration.source);
  best->toml.insert(0, "# Made by lamina design. By its forward run: " + segment::told_by(best->forward) + ".\n" +
                           std::string(segment::kDesignedJobRuns));
  return *best;
}

}  // namespace lamina::pipeline
