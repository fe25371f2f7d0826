// lamina design: computes the job of segmented lines for target pores, porosity or permeability.
#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/errors.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/pores/design.h"
#include "stages/segment/permeability.h"  // the unit
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

constexpr const char *kTargets = "Target: one or two of them", *kGradient = "Regions of a target with two ends";

CommandSpec design_spec() {
  CommandSpec spec;
  spec.summary =
      "Designs a segmented filling with the target porosity, permeability or pore size, within the printer's calibration.\n"
      "Checks it with the flow solver, reports the result and writes a job file. A target that cannot be met gives exit\n"
      "code 5 and the nearest feasible values.";
  spec.options = {
      {"--porosity", "PERCENT", "porosity of the filling in %: 24, or 20:26 from bottom to top", "", kTargets},
      {"--permeability", "DARCY", "k1 along the height in darcy: 100, or 60:150 from bottom to top", "", kTargets},
      {"--pore", "WIDTHxLENGTH", "pore width and length in mm: 0.12x0.9, or 0.1x0.9:0.14x0.9 upwards", "", kTargets},
      {"--height", "MM", "height of the part in mm, for targets with two ends", "", kGradient},
      {"--steps", "N", "number of regions of equal height", "5", kGradient},
      {"--tops", "MM[,MM...]", "ascending tops of the regions in mm; the last is the part's height", "", kGradient},
      {"--machine", "NAME|FILE", "extrusion printer; see lamina machines", "", "Machine", names_of(shipped_extruders())},
      {"--voxel", "UM", "voxel width across lines in micrometres; length: twice, height: same", "10", "Solver"},
      {"-o,--output", "FILE", "job file to write, as in pores.toml; default: report only", "", "Result"},
      {"--nearest", "", "write the nearest job if the target cannot be met (exit code 0)", "", "Result"},
      {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
      {"--json", "", "print the result as one JSON object on stdout", "", "Result"},
      {"--quiet", "", "print errors only", "", "Result"}};
  spec.closing =
      "A target is met if the solver's result for the plan is within 5 % of it; for a pore, what\n"
      "lamina extrude reports. Regions end with whole layers; each is checked in the middle of one file of all of them.\n"
      "docs/howto/design_pores.md states assumptions and measurements.\n\n"
      "Examples:\n"
      "  lamina design --porosity 24 --permeability 100 --machine anet-a8 -o pores.toml\n"
      "  lamina design --pore 0.12x0.9 --machine anet-a8 --voxel 20 -o pores.toml\n"
      "  lamina design --permeability 60:150 --height 25.4 --steps 3 --voxel 20 --machine anet-a8 -o pores.toml\n"
      "  lamina extrude part.stl --job pores.toml -o part.gcode";
  return spec;
}

/// A target at the bottom and at the top; the same where it has no gradient.
struct TargetEnds {
  segment::PoreTarget bottom, top;
  bool gradient = false;
};

/// Gives the texts of both ends to a reader. errors  kUsage
Status read_ends(const Arguments& arguments, const char* flag, TargetEnds& target,
                 const std::function<std::string(std::string_view, segment::PoreTarget&)>& read) {
  if (!arguments.has(flag)) return {};
  const std::string text = arguments.text(flag);
  const auto ends = split(text, ":");
  if (ends.size() > 2)
    return at_option(flag, fmt::format("'{}' has more than two ends; name those at the bottom and at the top", one_line(text)));
  target.gradient = target.gradient || ends.size() == 2;
  if (const Status status = at_option(flag, read(ends.front(), target.bottom)); !status) return status;
  return at_option(flag, read(ends.back(), target.top));
}

std::string read_pore(std::string_view text, segment::PoreTarget& target) {
  const auto sides = split(text, "x");
  std::array<double, 2> side{};
  if (sides.size() != 2) return fmt::format("'{}' is no width and length, as in 0.12x0.9", one_line(std::string(text)));
  for (std::size_t i = 0; i < 2; ++i) {
    if (std::string wrong = read_number(sides[i], 0.001, 100, " mm", side[i]); !wrong.empty()) return wrong;
  }
  if (side[0] >= side[1]) return fmt::format("{} mm is the width and has to be less than the length, {} mm", side[0], side[1]);
  target.pore_width_mm = side[0];
  target.pore_length_mm = side[1];
  return {};
}

/// A number, multiplied by the unit in which it is given.
auto number_reader(const Limits& limits, double unit, std::optional<double> segment::PoreTarget::*member) {
  return [limits, unit, member](std::string_view text, segment::PoreTarget& target) {
    double value = 0;
    std::string wrong = read_value(text, limits, value);
    if (wrong.empty()) target.*member = value * unit;
    return wrong;
  };
}

/// errors  kUsage
Result<TargetEnds> read_target(const Arguments& arguments) {
  TargetEnds target;
  for (const Status& status :
       {read_ends(arguments, "--porosity", target, number_reader({0.1, 99, " %"}, 0.01, &segment::PoreTarget::porosity)),
        read_ends(arguments, "--permeability", target,
                  number_reader({1e-3, 1e6, " D"}, segment::kDarcy, &segment::PoreTarget::permeability_m2)),
        read_ends(arguments, "--pore", target, read_pore)}) {
    if (!status) return status.error();
  }
  const int targets = arguments.has("--porosity") + arguments.has("--permeability") + arguments.has("--pore");
  if (targets == 0) return usage("no target; add --porosity, --permeability or --pore");
  if (targets == 3) return usage("--porosity, --permeability and --pore are more than a filling can follow; leave one out");
  return target;
}

/// The regions of a gradient. errors  kUsage
Result<std::vector<segment::TargetStep>> read_steps(const Arguments& arguments, const TargetEnds& target) {
  if (arguments.has("--tops") && (arguments.has("--height") || arguments.has("--steps")))
    return usage("--tops says all regions, --height and --steps make equal ones; give one of the two");
  const auto profile = designable_extruder(arguments.text("--machine"));
  if (!profile) return profile.error();
  const double layer_mm = profile->calibration.height_mm;
  std::vector<double> tops_mm;
  double height = 0;
  std::uint32_t steps = 5;
  for (const Status& status :
       {arguments.read("--height", {0.1, 1000, " mm"}, height), arguments.read("--steps", {2, segment::kMaxRegions}, steps)}) {
    if (!status) return status.error();
  }
  if (arguments.has("--tops")) {
    const std::string requested = arguments.text("--tops");
    for (const std::string_view top : split(requested, ",")) {
      if (const std::string wrong = read_number(top, 0.1, 1000, " mm", tops_mm.emplace_back()); !wrong.empty())
        return at_option("--tops", wrong).error();
    }
  } else if (!arguments.has("--height")) {
    return usage("a gradient needs the part's height; give --height MM, or --tops MM,MM,... of its regions");
  }
  const bool equal = tops_mm.empty();
  auto tops = equal ? segment::equal_tops(height, steps, layer_mm) : segment::whole_tops(tops_mm, layer_mm);
  if (!tops) return at_option(equal ? "--steps" : "--tops", tops.error().message).error();
  if (const double maximum = profile->machine.bed.build_height_mm; tops->back() > maximum)
    return at_option(equal ? "--height" : "--tops", fmt::format("{:g} mm is higher than the {:g} mm that {} builds",
                                                                tops->back(), maximum, profile->machine.name))
        .error();
  return segment::steps_of(target.bottom, target.top, *tops);
}

Result<DesignRequest> read_request(const Arguments& arguments) {
  DesignRequest request;
  request.machine = arguments.text("--machine");
  request.nearest = arguments.has("--nearest");
  double voxel = 10;
  if (const Status status = arguments.read("--voxel", {1, 50, " um"}, voxel); !status) return status.error();
  request.grid = {voxel, 2 * voxel, voxel, request.grid.positions};
  return request;
}

/// Reports the result and writes it, if it meets the target or the nearest is accepted. missed  of the error otherwise
template <class Found>
Outcome give_found(const Found& found, const DesignRequest& request, const std::string& missed, const Arguments& arguments,
                   Context& context) {
  const std::string output = arguments.text("-o,--output");
  if (!arguments.has("--quiet")) context.say_text(as_text(found));
  const bool enough = found.met || arguments.has("--nearest"), written = !output.empty() && enough;
  if (written) {
    if (const Status status = write_file(output, found.toml); !status) return status;
  }
  if (arguments.has("--json")) {
    Json json = as_json(found, written ? output : "");
    json["reach"] = as_json(request.reach);
    if (const Status status = context.give(json); !status) return status;
  }
  if (enough) return {};
  return failure(Fault::kVerification, "not reachable: {}; write it with --nearest", missed);
}

/// Prints what the machine reaches before anything is searched.
Status find_reach(const std::vector<segment::PoreTarget>& targets, const std::function<bool(double)>& go_on,
                  const Arguments& arguments, Context& context, DesignRequest& request) {
  keep_on_signals();
  auto reach = reachable(request.machine, go_on);
  if (!reach) return reach.error();
  request.reach = std::move(*reach);
  const auto outside = [&](const segment::PoreTarget& target) { return segment::out_of_reach(target, request.reach); };
  if (!arguments.has("--quiet")) context.say_text(as_text(request.reach, std::ranges::any_of(targets, outside)));
  return {};
}

Outcome run_design(const Arguments& arguments, Context& context) {
  if (!arguments.has("--machine")) return usage("--machine is missing; name an extrusion printer, as lamina extrude takes it");
  const auto target = read_target(arguments);
  if (!target) return target.error();
  auto request = read_request(arguments);
  if (!request) return request.error();
  if (const Status status = check_folder("-o", arguments.text("-o,--output")); !status) return status;
  const std::atomic<bool>& cancel = context.cancel();
  const auto go_on = [&](double) { return !cancel; };
  if (target->gradient) {
    const auto steps = read_steps(arguments, *target);
    if (!steps) return steps.error();
    if (const Status status = find_reach({steps->front().target, steps->back().target}, go_on, arguments, context, *request);
        !status)
      return status;
    const auto found = design_gradient(*request, *steps, go_on);
    if (!found) return found.error();
    return give_found(*found, *request, missed_text(*found), arguments, context);
  }
  for (const char* flag : {"--height", "--steps", "--tops"})
    if (arguments.has(flag)) return at_option(flag, "needs a gradient, as in --porosity 20:26");
  request->target = target->bottom;
  if (const Status status = find_reach({request->target}, go_on, arguments, context, *request); !status) return status;
  const auto found = design_job(*request, go_on);
  if (!found) return found.error();
  return give_found(*found, *request,
                    fmt::format("nearest is {}, which misses the target by {:.0f} %", nearest_text(request->target, *found),
                                100 * found->miss),
                    arguments, context);
}

}  // namespace

const Command design_command = {"design", "find a filling of a target porosity, permeability or pore size", design_spec,
                                run_design};

}  // namespace lamina::pipeline
