#include "pipeline/calibrate/design.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "stages/data/text/number_text.h"
#include "stages/data/text/readable.h"
#include "stages/data/text/toml.h"
#include "stages/segment/permeability.h"  // the unit

namespace lamina::pipeline {
namespace {

constexpr double kNear = 0.04;  // a forward run that misses by so little ends the search
constexpr double kNoNearer = 0.02;
constexpr double kFirst = 0.85;  // k1 of forward runs / of slots, as most plans have it: where the search begins

/// The job's keys, as a person would write them.
std::string keys_text(const std::string& machine, const segment::Settings& keys, const ExtruderProfile& used) {
  const Calibration& calibration = used.calibration;
  std::string profile = machine;
  if (machine.ends_with(".toml") || machine.find('/') != std::string::npos)
    profile = std::filesystem::absolute(machine).string();
  const std::string speed = used.machine.speed.print_mm_s == calibration.speed_mm_s
                                ? std::string()
                                : fmt::format("[extrude]\nprint_mm_s = {}\n\n", number_text(calibration.speed_mm_s));
  return speed +
         fmt::format(
             "[layers]\nthickness_mm = {}\n\n[machine]\nprofile = {}\n\n"
             "[fill]\npattern = \"raster\"\nwidth_mm = {}\nwalls = 1\nangle_deg = 90\nangle_step_deg = 0\n\n"
             "[segment]\non = true\nrule = \"aligned\"\nthick_mm = {}\nthin_mm = {}\ncontinuous_lines = {}\nspacing_sc_mm = {}\n"
             "spacing_cc_mm = {}\nthick_extrusion_percent = {}\nthick_speed_percent = {}\nthin_speed_percent = {}\n",
             number_text(calibration.height_mm), toml_string(profile), number_text(calibration.width_mm),
             number_text(keys.thick_mm), number_text(keys.thin_mm), keys.continuous, number_text(*keys.spacing_sc_mm),
             number_text(*keys.spacing_cc_mm), number_text(keys.thick_extrusion), number_text(*keys.thick_speed),
             number_text(keys.thin_speed));
}

/// What the forward run says, as comments; the first line tells whose file it is.
std::string head_text(const ForwardRun& forward) {
  return fmt::format(
      "# Made by lamina design. By its forward run: porosity {:.2f} %, k1 {:.4g} +- {:.2g} D along z, pores {:.3f} x {:.2f} mm.\n"
      "# lamina extrude PART.stl --job FILE.toml -o PART.gcode\n\n",
      100 * forward.porosity, forward.permeability_m2 / segment::kDarcy, forward.permeability_error_m2 / segment::kDarcy,
      forward.pore_width_mm, forward.pore_length_mm);
}

/// The miss of a forward run.
double miss_of(const segment::PoreWish& wish, const ForwardRun& forward) {
  segment::Slots slots{forward.porosity, forward.permeability_m2, 0};
  segment::Pores pores{};
  pores.width_mm = forward.pore_width_mm;
  pores.length_mm = forward.pore_length_mm;
  return segment::miss_of(wish, slots, pores);
}

/// What of a choice lies beside what was measured.
std::vector<std::string> outside_of(const segment::DesignLimits& limits, const segment::Choice& choice) {
  const auto beyond = limits.beyond(choice);
  std::vector<std::string> lines;
  const auto add = [&](std::size_t i, std::string text) {
    if (std::abs(beyond[i]) > 0.02) lines.push_back(std::move(text));
  };
  add(0, fmt::format("extrusion {:.1f} % lies between those measured", choice.extrusion));
  add(1, fmt::format("thick stretches of {:.2f} mm; 1.5 were measured", choice.thick_mm));
  add(2, fmt::format("thin stretches of {:.2f} mm; 1.5 to 2 were measured", choice.thin_mm));
  add(3, fmt::format("thick beads {:+.4f} mm from their neighbours; 0 to 0.01 were measured", choice.gap_mm));
  return lines;
}

}  // namespace

Result<DesignedJob> design_job(const DesignRequest& request, const std::function<bool(double)>& tell) {
  const auto profile = find_extruder(request.machine);
  if (!profile) return Error{profile.error().fault, "--machine: " + profile.error().message};
  if (profile->machine.format != "gcode")
    return Error{Fault::kUsage, fmt::format("--machine: {} writes {}; pores are designed for machines of G-code",
                                            one_line(request.machine), profile->machine.format)};
  const Calibration& calibration = profile->calibration;
  const auto limits = segment::DesignLimits::of(profile->machine, calibration);
  if (!limits) return Error{limits.error().fault, fmt::format("--machine {}: {}", request.machine, limits.error().message)};
  segment::SlotRatio ratio{1, kFirst};
  std::optional<DesignedJob> best;
  std::uint32_t runs = 0;
  for (; runs < request.most_runs;) {
    DesignedJob tried;
    tried.design = segment::search(request.wish, *limits, ratio);
    // Out of reach, and no run to come is nearer.
    if (best && tried.design.miss > request.tolerance && tried.design.miss > best->miss - kNoNearer) break;
    tried.toml = keys_text(request.machine, tried.design.settings, *profile);
    if (best && tried.toml == best->toml) break;
    Job job;
    if (const Status status = read_job_text(tried.toml, "the job", job); !status) return status.error();
    const auto forward = run_forward(job, request.machine, tried.design.plan, request.grid,
                                     [&](double share) { return tell((runs + share) / request.most_runs); });
    if (!forward) return forward.error();
    ++runs;
    tried.forward = *forward;
    tried.miss = miss_of(request.wish, *forward);
    tried.met = tried.miss <= request.tolerance;
    tried.outside = outside_of(*limits, tried.design.choice);
    // The slots without the ratios of before.
    const double flow = tried.design.slots.permeability_m2 / ratio.permeability;
    const double void_share = tried.design.slots.porosity / ratio.porosity;
    tried.model_ratio = flow > 0 ? forward->permeability_m2 / flow : 1;
    // From the second run on half of the way: plans that are far from each other have other ratios, and the search would go
    // to and fro between them.
    const auto correct = [&](double& old, double found, double model) {
      if (found > 0 && model > 0) old = runs > 1 ? std::sqrt(old * found / model) : found / model;
    };
    correct(ratio.permeability, forward->permeability_m2, flow);
    correct(ratio.porosity, forward->porosity, void_share);
    if (!best || tried.miss < best->miss) best = std::move(tried);
    if (best->miss <= kNear) break;
  }
  best->runs = runs;
  best->widths = one_line(calibration.source);
  best->toml.insert(0, head_text(best->forward));
  return *best;
}

}  // namespace lamina::pipeline
