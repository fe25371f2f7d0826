#include "pipeline/pores/gradient.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "pipeline/job/file.h"
#include "stages/segment/design/design_page.h"
#include "stages/segment/design/job_text.h"

namespace lamina::pipeline {
namespace {

constexpr double kLeastNear = 0.01;  // walls fall between voxels

/// Of one step: with the number of lines that all share, or where that misses with any.
Result<DesignedJob> design_step(DesignRequest request, const segment::WishStep& step, std::uint32_t lines,
                                const std::function<bool(double)>& tell) {
  request.wish = step.wish;
  if (lines == 0) return design_job(request, tell);
  request.lines = {lines, lines};
  auto shared = design_job(request, tell);
  if (!shared || shared->met) return shared;
  request.lines = {};
  request.known = shared->known;
  auto own = design_job(request, tell);
  if (!own) return own;
  own->runs += shared->runs;
  if (own->miss < shared->miss) return own;
  shared->runs = own->runs;
  return shared;
}

/// Neighbouring regions are not taken for each other: a quarter of the way from one wish to the next is near enough.
double near_of(const std::vector<segment::WishStep>& steps, double most) {
  const auto way = [](const std::optional<double>& one, const std::optional<double>& next) {
    return one && next ? std::abs(*next / *one - 1) : 0.0;
  };
  double least = 4 * most;
  for (std::size_t i = 0; i + 1 < steps.size(); ++i) {
    const segment::PoreWish &one = steps[i].wish, &next = steps[i + 1].wish;
    least =
        std::min(least, std::max({way(one.porosity, next.porosity), way(one.permeability_m2, next.permeability_m2),
                                  way(one.pore_width_mm, next.pore_width_mm), way(one.pore_length_mm, next.pore_length_mm)}));
  }
  return std::max(kLeastNear, least / 4);
}

/// Within the layer in the middle of a step.
double middle_of(const segment::WishStep& step, double layer_mm) {
  const double layers = std::round((step.to_mm - step.from_mm) / layer_mm);
  return step.from_mm + (std::floor(layers / 2) + 0.5) * layer_mm;
}

/// What the one file of all regions says takes the place of what the steps' own runs said.
Status check_together(const DesignRequest& request, double layer_mm, GradientJob& all,
                      const std::function<bool(double)>& tell) {
  Job job;
  if (const Status status = read_job_text(all.toml, "the job", job); !status) return status.error();
  std::vector<ForwardRegion> regions;
  for (const GradientStep& one : all.steps) {
    regions.push_back(
        {one.found.design.plan, middle_of(one.step, layer_mm), segment::heights_text(one.step.from_mm, one.step.to_mm)});
  }
  const auto forward = run_forward(job, request.machine, all.steps.back().step.to_mm, regions, request.grid, tell);
  if (!forward) return forward.error();
  const double height = all.steps.back().step.to_mm;
  double resistance = 0;
  for (std::size_t i = 0; i < all.steps.size(); ++i) {
    GradientStep& one = all.steps[i];
    one.found.forward = forward->at(i);
    one.found.miss = segment::miss_of(one.step.wish, one.found.forward);
    one.found.met = one.found.miss <= request.tolerance;
    const double share = (one.step.to_mm - one.step.from_mm) / height;
    all.porosity += share * one.found.forward.porosity;
    resistance += share / std::max(one.found.forward.permeability_m2, 1e-30);
  }
  all.permeability_m2 = 1 / resistance;
  all.runs += static_cast<std::uint32_t>(all.steps.size());
  return {};
}

}  // namespace

Result<GradientJob> design_gradient(const DesignRequest& request, const std::vector<segment::WishStep>& steps,
                                    const std::function<bool(double)>& tell) {
  const auto profile = designable_extruder(request.machine);
  if (!profile) return profile.error();
  const auto limits = segment::DesignLimits::of(profile->machine, profile->calibration);
  if (!limits) return Error{limits.error().fault, fmt::format("--machine {}: {}", request.machine, limits.error().message)};
  const std::uint32_t lines = segment::common_lines(steps, *limits, request.ratio, request.tolerance);
  const double parts = static_cast<double>(steps.size()) + 1;
  DesignRequest next = request;
  next.near = near_of(steps, request.near);
  GradientJob all;
  std::vector<segment::DesignRange> ranges;
  for (const segment::WishStep& step : steps) {
    const double done = static_cast<double>(all.steps.size());
    auto found = design_step(next, step, lines, [&](double share) { return tell((done + share) / parts); });
    if (!found) return found.error();
    next.known = found->known;
    all.runs += found->runs;
    ranges.push_back({step.from_mm, step.to_mm, found->design.settings});
    all.steps.push_back({step, std::move(*found)});
  }
  all.toml = segment::designed_job_text(request.machine, *profile, ranges);
  const double layer_mm = profile->calibration.height_mm;
  if (const Status status =
          check_together(request, layer_mm, all, [&](double share) { return tell((parts - 1 + share) / parts); });
      !status)
    return status.error();
  std::string head = "# Made by lamina design. By one forward run of all regions:\n";
  all.met = true;
  all.lines = all.steps.front().found.design.settings.continuous;
  for (const auto& [step, found] : all.steps) {
    head += fmt::format("# {}: {}\n", segment::heights_text(step.from_mm, step.to_mm), segment::told_by(found.forward));
    all.met = all.met && found.met;
    all.miss = std::max(all.miss, found.miss);
    if (found.design.settings.continuous != all.lines) all.lines = 0;
  }
  all.toml.insert(0, head + std::string(segment::kDesignedJobRuns));
  return all;
}

}  // namespace lamina::pipeline
