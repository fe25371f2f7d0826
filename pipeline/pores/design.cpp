#include "pipeline/pores/design.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "pipeline/job/file.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/report/summary.h"      // warnings_json
#include "stages/segment/permeability.h"  // the unit
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/toml.h"

namespace lamina::pipeline {
namespace {

/// "3 to 5.7 mm", as a summary names the pores of a range.
std::string heights_text(double from_mm, double to_mm) {
  return fmt::format("{} to {} mm", number_text(from_mm), number_text(to_mm));
}

constexpr double kNoNearer = 0.02;
constexpr std::uint32_t kOutsideRuns = 4;  // forward runs that show what is nearest to a target out of reach
constexpr double kClearlyMissed = 2;       // tolerances: the one file of all regions cannot make up for it
constexpr ForwardGrid kReachGrid{20, 40, 20, 1};
constexpr double kMinNear = 0.01;  // walls fall between voxels

/// The last comment before the keys.
constexpr std::string_view kDesignedJobRuns = "# lamina extrude PART.stl --job FILE.toml -o PART.gcode\n\n";

std::string segment_text(const segment::SegmentSettings& keys) {
  return fmt::format(
      "on = true\nrule = \"aligned\"\nthick_mm = {}\nthin_mm = {}\ncontinuous_lines = {}\nspacing_sc_mm = {}\n"
      "spacing_cc_mm = {}\nthick_extrusion_percent = {}\nthick_speed_percent = {}\nthin_speed_percent = {}\n",
      number_text(keys.thick_mm), number_text(keys.thin_mm), keys.continuous, number_text(*keys.spacing_sc_mm),
      number_text(*keys.spacing_cc_mm), number_text(keys.thick_extrusion), number_text(*keys.thick_speed),
      number_text(keys.thin_speed));
}

/// The keys of a job that fills with segmented lines, as a person would write them.
/// machine  as --machine takes it
std::string designed_job_text(const std::string& machine, const ExtruderProfile& used, const segment::SegmentSettings& keys) {
  const Calibration& calibration = used.calibration;
  std::string profile = machine;
  if (machine.ends_with(".toml") || machine.find('/') != std::string::npos)
    profile = std::filesystem::absolute(machine).string();
  const std::string speed = used.machine.speed.print_mm_s == calibration.speed_mm_s
                                ? std::string()
                                : fmt::format("[extrude]\nprint_mm_s = {}\n\n", number_text(calibration.speed_mm_s));
  return speed + fmt::format(
                     "[layers]\nthickness_mm = {}\n\n[machine]\nprofile = {}\n\n"
                     "[fill]\npattern = \"raster\"\nwidth_mm = {}\nwalls = 1\nangle_deg = 90\nangle_step_deg = 0\n\n"
                     "[segment]\n{}",
                     number_text(calibration.height_mm), toml_string(profile), number_text(calibration.width_mm),
                     segment_text(keys));
}

/// What fills a part between two heights.
struct DesignRange {
  double from_mm = 0, to_mm = 0;
  segment::SegmentSettings keys;
};

/// The same with ranges of heights; what lies above them is filled as the last one.
/// ranges  not empty
std::string designed_job_text(const std::string& machine, const ExtruderProfile& used, const std::vector<DesignRange>& ranges) {
  std::string text = designed_job_text(machine, used, ranges.back().keys);
  for (const DesignRange& range : ranges) {
    text += fmt::format("\n[[segment.range]]\nfrom_mm = {}\nto_mm = {}\n{}", number_text(range.from_mm),
                        number_text(range.to_mm), segment_text(range.keys));
  }
  return text;
}

/// Of the target that a forward run misses by most: relative.
double miss_of(const segment::PoreTarget& target, const ForwardRun& forward) {
  segment::Slots slots{forward.porosity, forward.permeability_m2, 0};
  segment::Pores pores{};
  pores.width_mm = forward.pore_width_mm;
  pores.length_mm = forward.pore_length_mm;
  return segment::miss_of(target, slots, pores);
}

/// What of a choice lies beyond what was measured, one line each.
std::vector<std::string> outside_of(const segment::DesignLimits& limits, const segment::Choice& choice) {
  const auto beyond = limits.beyond(choice);
  std::vector<std::string> lines;
  const auto add = [&](std::size_t i, std::string text) {
    if (std::abs(beyond[i]) > 0.02) lines.push_back(std::move(text));
  };
  add(0, fmt::format("extrusion {:.1f} % is between those measured", choice.extrusion));
  add(1, fmt::format("thick segments of {:.2f} mm; 1.5 were measured", choice.thick_mm));
  add(2, fmt::format("thin segments of {:.2f} mm; 1.5 to 2 were measured", choice.thin_mm));
  add(3, fmt::format("thick beads {:+.4f} mm from their neighbours; 0 to 0.01 were measured", choice.gap_mm));
  return lines;
}

/// What a person has to know of the printer.
std::vector<Warning> warnings_of(const ExtruderProfile& profile) {
  auto warning = calibration_warning(profile);
  return warning ? std::vector{std::move(*warning)} : std::vector<Warning>();
}

/// Of one step: with the number of lines that all share, or where that misses with any.
Result<DesignedJob> design_step(DesignRequest request, const segment::TargetStep& step, std::uint32_t lines,
                                const std::function<bool(double)>& report) {
  request.target = step.target;
  if (lines == 0) return design_job(request, report);
  request.lines = {lines, lines};
  auto shared = design_job(request, report);
  if (!shared || shared->met) return shared;
  request.lines = {};
  request.known = shared->known;
  auto own = design_job(request, report);
  if (!own) return own;
  own->runs += shared->runs;
  if (own->miss < shared->miss) return own;
  shared->runs = own->runs;
  return shared;
}

/// Neighbouring regions must stay distinct: a quarter of the way from one target to the next is near enough.
double near_of(const std::vector<segment::TargetStep>& steps, double maximum) {
  const auto way = [](const std::optional<double>& one, const std::optional<double>& next) {
    return one && next ? std::abs(*next / *one - 1) : 0.0;
  };
  double minimum = 4 * maximum;
  for (std::size_t i = 0; i + 1 < steps.size(); ++i) {
    const segment::PoreTarget &one = steps[i].target, &next = steps[i + 1].target;
    minimum =
        std::min(minimum, std::max({way(one.porosity, next.porosity), way(one.permeability_m2, next.permeability_m2),
                                    way(one.pore_width_mm, next.pore_width_mm), way(one.pore_length_mm, next.pore_length_mm)}));
  }
  return std::max(kMinNear, minimum / 4);
}

/// Within the layer in the middle of a step.
double middle_of(const segment::TargetStep& step, double layer_mm) {
  const double layers = std::round((step.to_mm - step.from_mm) / layer_mm);
  return step.from_mm + (std::floor(layers / 2) + 0.5) * layer_mm;
}

/// What the one file of all regions says takes the place of what the steps' own runs said.
Status check_together(const DesignRequest& request, double layer_mm, GradientJob& all,
                      const std::function<bool(double)>& report) {
  Job job;
  if (const Status status = read_job_text(all.toml, "the job", job); !status) return status.error();
  std::vector<ForwardRegion> regions;
  for (const GradientStep& one : all.steps) {
    regions.push_back({one.found.design.plan, middle_of(one.step, layer_mm), heights_text(one.step.from_mm, one.step.to_mm)});
  }
  const auto forward = run_forward(job, request.machine, all.steps.back().step.to_mm, regions, request.grid, report);
  if (!forward) return forward.error();
  const double height = all.steps.back().step.to_mm;
  double resistance = 0;
  for (std::size_t i = 0; i < all.steps.size(); ++i) {
    GradientStep& one = all.steps[i];
    one.found.forward = forward->at(i);
    one.found.miss = miss_of(one.step.target, one.found.forward);
    one.found.met = one.found.miss <= request.tolerance;
    const double share = (one.step.to_mm - one.step.from_mm) / height;
    all.porosity += share * one.found.forward.porosity;
    resistance += share / std::max(one.found.forward.permeability_m2, 1e-30);
  }
  all.permeability_m2 = 1 / resistance;
  all.runs += static_cast<std::uint32_t>(all.steps.size());
  return {};
}

/// A gradient whose last region is out of reach: those above it were not searched.
GradientJob missed_job(std::vector<GradientStep> steps) {
  GradientJob all;
  for (const GradientStep& one : steps) all.runs += one.found.runs;
  all.miss = steps.back().found.miss;
  all.steps = std::move(steps);
  return all;
}

constexpr std::string_view kSure =
    "accuracy  the range of k1 has the error of the voxels (+-) and the uncertainty of the acceleration; predicted k1 of\n"
    "          seven printed samples was 0.75 to 1.24 times the measured one, porosity within 2.3 points (bench/pores.md)\n";

/// Darcy.
K1Range range_of(const ForwardRun& forward) {
  return k1_range(forward.permeability_m2 / segment::kDarcy, forward.permeability_error_m2 / segment::kDarcy);
}

std::string lines_text(const segment::SegmentSettings& keys) {
  return fmt::format("thick {:g} mm, thin {:g} mm, {} continuous line{} between segmented ones, S-C {:g}, C-C {:g} mm",
                     keys.thick_mm, keys.thin_mm, keys.continuous, keys.continuous == 1 ? "" : "s", *keys.spacing_sc_mm,
                     *keys.spacing_cc_mm);
}

Json segment_json(const segment::SegmentSettings& keys) {
  return {{"thick_mm", keys.thick_mm},
          {"thin_mm", keys.thin_mm},
          {"continuous_lines", keys.continuous},
          {"spacing_sc_mm", *keys.spacing_sc_mm},
          {"spacing_cc_mm", *keys.spacing_cc_mm},
          {"thick_extrusion_percent", keys.thick_extrusion},
          {"thick_speed_percent", *keys.thick_speed},
          {"thin_speed_percent", keys.thin_speed}};
}

/// A line each.
std::string warnings_text(const std::vector<Warning>& warnings) {
  std::string text;
  for (const Warning& warning : warnings) text += fmt::format("warning   {}\n", one_line(warning.text));
  return text;
}

/// The targets, as options.
std::string target_text(const segment::PoreTarget& target) {
  std::string text;
  const auto add = [&](const std::string& part) { text += (text.empty() ? "" : " ") + part; };
  if (target.porosity) add(fmt::format("--porosity {:.4g}", 100 * *target.porosity));
  if (target.permeability_m2) add(fmt::format("--permeability {:.4g}", *target.permeability_m2 / segment::kDarcy));
  if (target.pore_width_mm) add(fmt::format("--pore {:.3g}x{:.3g}", *target.pore_width_mm, *target.pore_length_mm));
  return text;
}

Json target_json(const segment::PoreTarget& target) {
  Json json = Json::object();
  if (target.porosity) json["porosity"] = *target.porosity;
  if (target.permeability_m2) json["k1_darcy"] = *target.permeability_m2 / segment::kDarcy;
  if (target.pore_width_mm) json["pore_mm"] = {*target.pore_width_mm, *target.pore_length_mm};
  return json;
}

/// The filling and what its forward run says, into an object.
void report_plan(const DesignedJob& found, Json& json) {
  const ForwardRun& forward = found.forward;
  json["segment"] = segment_json(found.design.settings);
  json["porosity"] = forward.porosity;
  json["porosity_through"] = forward.porosity_through;
  json["k1_darcy"] = forward.permeability_m2 / segment::kDarcy;
  json["k1_error_darcy"] = forward.permeability_error_m2 / segment::kDarcy;
  const K1Range range = range_of(forward);
  json["k1_range_darcy"] = {range.low, range.high};
  json["resolved"] = forward.resolved;
  json["throat_mm"] = found.design.slots.throat_mm;
  json["pore_mm"] = {forward.pore_width_mm, forward.pore_length_mm};
}

Json step_json(const GradientStep& one) {
  Json json{{"from_mm", one.step.from_mm},
            {"to_mm", one.step.to_mm},
            {"target", target_json(one.step.target)},
            {"met", one.found.met},
            {"miss", one.found.miss}};
  report_plan(one.found, json);
  json["beyond_measured"] = one.found.outside;
  return json;
}

std::string step_text(const GradientStep& one) {
  const segment::SegmentSettings& keys = one.found.design.settings;
  const ForwardRun& forward = one.found.forward;
  std::string text =
      fmt::format("{}: target {}\n", heights_text(one.step.from_mm, one.step.to_mm), target_text(one.step.target));
  text += one.found.met ? fmt::format("  is        {}; within {:.1f} %\n", predicted_lines(forward), 100 * one.found.miss)
                        : fmt::format("  nearest   {}; not reachable, misses the target by {:.0f} %\n",
                                      predicted_lines(forward), 100 * one.found.miss);
  text += fmt::format("  lines     {}\n  settings  {:g} % extrusion, thick {:g} %, thin {:g} % of the speed\n",
                      lines_text(keys), keys.thick_extrusion, *keys.thick_speed, keys.thin_speed);
  if (!forward.resolved) text += "  note      voxels are too coarse for the pores; take a smaller --voxel\n";
  for (const std::string& line : one.found.outside) text += fmt::format("  beyond    {}\n", line);
  return text;
}

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

Result<std::vector<segment::Reach>> reachable(const std::string& machine, const std::function<bool(double)>& report) {
  const auto profile = designable_extruder(machine);
  if (!profile) return profile.error();
  const auto limits = segment::DesignLimits::of(profile->machine, profile->calibration);
  if (!limits) return Error{limits.error().fault, fmt::format("--machine {}: {}", machine, limits.error().message)};
  const auto slots = segment::reach_of(*limits);
  std::vector<segment::Reach> reach(slots.begin(), slots.end());
  const auto run_of = [&](const segment::Choice& choice) -> Result<ForwardRun> {
    const segment::SegmentSettings settings = limits->settings_of(choice);
    const auto plan = limits->plan_of(settings);
    if (!plan) return plan.error();
    Job job;
    if (const Status status = read_job_text(designed_job_text(machine, *profile, settings), "the job", job); !status)
      return status.error();
    return run_forward(job, machine, *plan, kReachGrid, report);
  };
  const segment::Reach few = reach.front(), many = reach.back();  // lines
  const auto low = run_of(many.tightest);
  if (!low) return low.error();
  const auto high = run_of(few.widest);
  if (!high) return high.error();
  const auto ratio = [](double run, double of_slots) { return of_slots > 0 ? run / of_slots : 1; };
  const double at_low = ratio(low->permeability_m2, many.permeability_m2.minimum);
  const double at_high = ratio(high->permeability_m2, few.permeability_m2.maximum);
  for (segment::Reach& one : reach)
    one.permeability_m2 = {one.permeability_m2.minimum * at_low, one.permeability_m2.maximum * at_high};
  return reach;
}

namespace {

/// The search of design_job() with what is known.
Result<DesignedJob> search_job(const DesignRequest& request, const std::function<bool(double)>& report) {
  const auto profile = designable_extruder(request.machine);
  if (!profile) return profile.error();
  const Calibration& calibration = profile->calibration;
  const auto limits = segment::DesignLimits::of(profile->machine, calibration);
  if (!limits) return Error{limits.error().fault, fmt::format("--machine {}: {}", request.machine, limits.error().message)};
  std::vector<segment::RatioAt> known = request.known;
  std::vector<std::string> tries;
  std::optional<DesignedJob> best;
  const bool outside = segment::out_of_reach(request.target, request.reach);
  const std::uint32_t max_runs = outside ? std::min(kOutsideRuns, request.max_runs) : request.max_runs;
  while (tries.size() < max_runs) {
    DesignedJob tried;
    tried.design = segment::search(request.target, *limits, request.ratio, request.lines, known);
    // Out of reach, and no run to come is nearer.
    if (best && tried.design.miss > request.tolerance && tried.design.miss > best->miss - kNoNearer) break;
    tried.toml = designed_job_text(request.machine, *profile, tried.design.settings);
    if (std::ranges::find(tries, tried.toml) != tries.end()) break;
    Job job;
    if (const Status status = read_job_text(tried.toml, "the job", job); !status) return status.error();
    const double done = static_cast<double>(tries.size());
    const auto forward = run_forward(job, request.machine, tried.design.plan, request.grid,
                                     [&](double share) { return report((done + share) / request.max_runs); });
    if (!forward) return forward.error();
    tries.push_back(tried.toml);
    tried.forward = *forward;
    tried.miss = miss_of(request.target, *forward);
    tried.met = tried.miss <= request.tolerance;
    tried.outside = outside_of(*limits, tried.design.choice);
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
  best->warnings = warnings_of(*profile);
  best->toml.insert(0, "# Made by lamina design. By its forward run: " + predicted_lines(best->forward) + ".\n" +
                           std::string(kDesignedJobRuns));
  return *best;
}

}  // namespace

Result<DesignedJob> design_job(const DesignRequest& request, const std::function<bool(double)>& report) {
  auto found = search_job(request, report);
  if (!found || found->met || !request.target.porosity) return found;
  // Slots say too much void where tables of widths do not conserve volume: once more, with what is fed.
  const auto profile = designable_extruder(request.machine);
  const auto limits = profile ? segment::DesignLimits::of(profile->machine, profile->calibration) : profile.error();
  if (!limits) return limits.error();
  DesignRequest again = request;
  again.known = segment::fed_ratios(*limits, request.ratio.permeability);
  again.known.insert(again.known.end(), found->known.begin(), found->known.end());
  auto second = search_job(again, report);
  if (!second) return second;
  second->runs = found->runs += second->runs;
  second->known = found->known;
  return second->miss < found->miss ? second : found;
}

Result<GradientJob> design_gradient(const DesignRequest& request, const std::vector<segment::TargetStep>& steps,
                                    const std::function<bool(double)>& report) {
  const auto profile = designable_extruder(request.machine);
  if (!profile) return profile.error();
  const auto limits = segment::DesignLimits::of(profile->machine, profile->calibration);
  if (!limits) return Error{limits.error().fault, fmt::format("--machine {}: {}", request.machine, limits.error().message)};
  const double parts = static_cast<double>(steps.size()) + 1;
  DesignRequest next = request;
  next.near = near_of(steps, request.near);
  GradientJob all;
  const auto ends_search = [&](const DesignedJob& found) {
    return !request.nearest && found.miss > kClearlyMissed * request.tolerance;
  };
  // Targets rise or fall from the first region to the last.
  for (const segment::TargetStep& step : {steps.front(), steps.back()}) {
    if (request.nearest || !segment::out_of_reach(step.target, request.reach)) continue;
    auto found = design_step(next, step, 0, report);
    if (!found) return found.error();
    if (ends_search(*found)) return missed_job({{step, std::move(*found)}});
  }
  const std::uint32_t lines = segment::common_lines(steps, *limits, request.ratio, request.tolerance);
  std::vector<DesignRange> ranges;
  for (const segment::TargetStep& step : steps) {
    const double done = static_cast<double>(all.steps.size());
    auto found = design_step(next, step, lines, [&](double share) { return report((done + share) / parts); });
    if (!found) return found.error();
    next.known = found->known;
    all.runs += found->runs;
    ranges.push_back({step.from_mm, step.to_mm, found->design.settings});
    all.steps.push_back({step, std::move(*found)});
    if (ends_search(all.steps.back().found)) return missed_job(std::move(all.steps));
  }
  all.toml = designed_job_text(request.machine, *profile, ranges);
  const double layer_mm = profile->calibration.height_mm;
  if (const Status status =
          check_together(request, layer_mm, all, [&](double share) { return report((parts - 1 + share) / parts); });
      !status)
    return status.error();
  std::string head = "# Made by lamina design. By one forward run of all regions:\n";
  all.met = true;
  all.lines = all.steps.front().found.design.settings.continuous;
  for (const auto& [step, found] : all.steps) {
    head += fmt::format("# {}: {}\n", heights_text(step.from_mm, step.to_mm), predicted_lines(found.forward));
    all.met = all.met && found.met;
    all.miss = std::max(all.miss, found.miss);
    if (found.design.settings.continuous != all.lines) all.lines = 0;
  }
  all.toml.insert(0, head + std::string(kDesignedJobRuns));
  return all;
}

std::string predicted_lines(const ForwardRun& forward) {
  const K1Range range = range_of(forward);
  return fmt::format("porosity {:.2f} %, k1 {:.4g} D along z ({:.3g} to {:.3g}), pores {:.3f} x {:.2f} mm",
                     100 * forward.porosity, forward.permeability_m2 / segment::kDarcy, range.low, range.high,
                     forward.pore_width_mm, forward.pore_length_mm);
}

std::string as_text(const std::vector<segment::Reach>& reach, bool outside) {
  std::string text = "reach     lines  porosity, %     k1, D           pores, mm\n";
  const auto row = [](const segment::Interval& interval, double unit) {
    return fmt::format("{:.3g} to {:.3g}", interval.minimum / unit, interval.maximum / unit);
  };
  for (std::size_t i = 0; i < reach.size(); ++i) {
    const segment::Reach& one = reach[i];
    text += fmt::format("          {:<7}{:<16}{:<16}{} x {}\n", i + 1, row(one.porosity, 0.01),
                        row(one.permeability_m2, segment::kDarcy), row(one.pore_width_mm, 1), row(one.pore_length_mm, 1));
  }
  return outside ? text + "target    out of this reach; the nearest filling follows\n" : text;
}

Json as_json(const std::vector<segment::Reach>& reach) {
  Json rows = Json::array();
  for (std::size_t i = 0; i < reach.size(); ++i) {
    const segment::Reach& one = reach[i];
    rows.push_back(
        {{"continuous_lines", i + 1},
         {"porosity", {one.porosity.minimum, one.porosity.maximum}},
         {"k1_darcy", {one.permeability_m2.minimum / segment::kDarcy, one.permeability_m2.maximum / segment::kDarcy}},
         {"pore_width_mm", {one.pore_width_mm.minimum, one.pore_width_mm.maximum}},
         {"pore_length_mm", {one.pore_length_mm.minimum, one.pore_length_mm.maximum}}});
  }
  return rows;
}

std::string as_text(const DesignedJob& found) {
  const segment::SegmentSettings& keys = found.design.settings;
  const ForwardRun& forward = found.forward;
  const K1Range range = range_of(forward);
  std::string text = fmt::format("lines     {}\nsettings  {:g} % extrusion, thick {:g} %, thin {:g} % of the speed\n",
                                 lines_text(keys), keys.thick_extrusion, *keys.thick_speed, keys.thin_speed);
  text +=
      fmt::format("porosity  {:.2f} %, {:.2f} % connected along z\n", 100 * forward.porosity, 100 * forward.porosity_through);
  text += fmt::format("along z   k1 {:.4g} +- {:.2g} D ({:.4e} m2), {:.3g} to {:.3g} D; throat {:.3f} mm\n",
                      forward.permeability_m2 / segment::kDarcy, forward.permeability_error_m2 / segment::kDarcy,
                      forward.permeability_m2, range.low, range.high, found.design.slots.throat_mm);
  text += fmt::format("pores     {:.3f} x {:.2f} mm\n", forward.pore_width_mm, forward.pore_length_mm);
  text += kSure;
  if (!found.widths.empty()) text += fmt::format("widths    {}\n", found.widths);
  if (!forward.resolved) text += "note      voxels are too coarse for the pores; take a smaller --voxel\n";
  for (const std::string& line : found.outside) text += fmt::format("beyond    {}\n", line);
  if (found.outside.empty()) text += "beyond    nothing: lengths, gaps and extrusion are those that were measured\n";
  text += warnings_text(found.warnings);
  return text + fmt::format("checked   by {} forward run{}; the target is {} {:.1f} %\n", found.runs,
                            found.runs == 1 ? "" : "s", found.miss > 0.1 ? "missed by" : "met within", 100 * found.miss);
}

Json as_json(const DesignedJob& found, const std::string& output) {
  Json json{{"command", "design"}, {"met", found.met}, {"miss", found.miss}, {"job", output}};
  report_plan(found, json);
  json["runs"] = found.runs;
  json["k1_over_slots"] = found.model_ratio;
  json["widths"] = found.widths;
  json["warnings"] = warnings_json(found.warnings);
  json["beyond_measured"] = found.outside;
  return json;
}

std::string as_text(const GradientJob& found) {
  std::string text;
  for (const GradientStep& one : found.steps) text += step_text(one);
  if (found.toml.empty()) return text + warnings_text(found.steps.front().found.warnings);
  text += fmt::format(
      "whole     porosity {:.2f} %, k1 of the regions in series {:.4g} D along z; where two regions meet, pores\n"
      "          overlap only in part, which lowers k1\n",
      100 * found.porosity, found.permeability_m2 / segment::kDarcy);
  text += kSure;
  if (const std::string& widths = found.steps.front().found.widths; !widths.empty())
    text += fmt::format("widths    {}\n", widths);
  text += warnings_text(found.steps.front().found.warnings);
  return text +
         fmt::format("checked   by {} forward runs, the last {} in one file of all regions; targets are met within {:.1f} %\n",
                     found.runs, found.steps.size(), 100 * found.miss);
}

Json as_json(const GradientJob& found, const std::string& output) {
  Json json = {{"command", "design"}, {"met", found.met}, {"miss", found.miss}, {"job", output}, {"steps", Json::array()}};
  for (const GradientStep& one : found.steps) json["steps"].push_back(step_json(one));
  if (!found.toml.empty()) {
    json["porosity"] = found.porosity;
    json["k1_in_series_darcy"] = found.permeability_m2 / segment::kDarcy;
    json["continuous_lines"] = found.lines;
  }
  json["runs"] = found.runs;
  json["widths"] = found.steps.front().found.widths;
  json["warnings"] = warnings_json(found.steps.front().found.warnings);
  return json;
}

std::string nearest_text(const segment::PoreTarget& target, const DesignedJob& found) {
  const ForwardRun& forward = found.forward;
  std::string text;
  const auto add = [&](bool requested_range, const std::string& part) {
    if (requested_range) text += (text.empty() ? "" : ", ") + part;
  };
  add(target.porosity.has_value(), fmt::format("--porosity {:.2f}", 100 * forward.porosity));
  add(target.permeability_m2.has_value(), fmt::format("--permeability {:.4g}", forward.permeability_m2 / segment::kDarcy));
  add(target.pore_width_mm.has_value(), fmt::format("--pore {:.3f}x{:.2f}", forward.pore_width_mm, forward.pore_length_mm));
  return text;
}

std::string missed_text(const GradientJob& found) {
  std::size_t missed = 0;
  const GradientStep* first = nullptr;
  for (const GradientStep& one : found.steps) {
    if (one.found.met) continue;
    if (first == nullptr) first = &one;
    ++missed;
  }
  if (first == nullptr) return {};
  const std::string regions = found.toml.empty() ? "" : fmt::format("{} of {} regions; ", missed, found.steps.size());
  return fmt::format("{}from {} nearest to {} is {}, which misses it by {:.0f} %", regions,
                     heights_text(first->step.from_mm, first->step.to_mm), target_text(first->step.target),
                     nearest_text(first->step.target, first->found), 100 * first->found.miss);
}

}  // namespace lamina::pipeline
