// lamina design: the job of segmented lines whose pores, porosity or permeability are as wished.
#include <fmt/format.h>

#include "pipeline/calibrate/design.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/machine/profiles.h"
#include "stages/data/text/json.h"
#include "stages/data/text/number_text.h"
#include "stages/data/text/readable.h"
#include "stages/segment/permeability.h"  // the unit
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

CommandSpec design_spec() {
  CommandSpec spec;
  spec.summary =
      "Finds the segmented filling whose pores are as wished: lengths of thick and thin stretches, spacing, extrusion, speeds and\n"
      "continuous lines, within what was measured of the machine. Plans it, solves the flow through what is laid, tells what it\n"
      "will be, and writes the job file. A wish that cannot be met ends with exit code 5 and the nearest that can.";
  spec.options = {
      {"--porosity", "PERCENT", "void in the filling", "", "Wish: one or two of them"},
      {"--permeability", "DARCY", "k1 along the height", "", "Wish: one or two of them"},
      {"--pore", "WIDTHxLENGTH", "mm, of the pore beside a thin stretch, as in 0.12x0.9", "", "Wish: one or two of them"},
      {"--machine", "NAME|FILE", "extrusion printer; lamina extrude --help lists them", "", "Machine",
       names_of(shipped_extruders())},
      {"--voxel", "UM", "edge of a voxel across the lines, micrometres; twice as long, as high", "10", "Solver"},
      {"-o,--output", "FILE", "job file to be written, as in pores.toml; else it is told alone", "", "Result"},
      {"--nearest", "", "write the nearest job where the wish cannot be met, and end as if it were met", "", "Result"},
      {"--overwrite", "", "replace a file that lamina did not write", "", "Result"},
      {"--json", "", "print the result as one JSON object on stdout", "", "Result"},
      {"--quiet", "", "say nothing but errors", "", "Result"}};
  spec.closing =
      "A wish is met if what the solver says of the plan is within 5 % of it; of a pore, what\n"
      "lamina extrude tells of it. docs/design.md tells what is assumed and measured.\n\n"
      "Examples:\n"
      "  lamina design --porosity 24 --permeability 100 --machine anet-a8 -o pores.toml\n"
      "  lamina design --pore 0.12x0.9 --machine anet-a8 --voxel 20 -o pores.toml\n"
      "  lamina extrude part.stl --job pores.toml -o part.gcode";
  return spec;
}

Status read_pore(const Arguments& arguments, segment::PoreWish& wish) {
  if (!arguments.has("--pore")) return {};
  const std::string text = arguments.text("--pore");
  const auto sides = split(text, "x");
  std::array<double, 2> side{};
  if (sides.size() != 2) return at_option("--pore", fmt::format("'{}' is no width and length, as in 0.12x0.9", one_line(text)));
  for (std::size_t i = 0; i < 2; ++i) {
    if (const std::string wrong = read_number(sides[i], 0.001, 100, " mm", side[i]); !wrong.empty())
      return at_option("--pore", wrong);
  }
  if (side[0] >= side[1])
    return at_option("--pore", fmt::format("{} mm is the width and has to be less than the length, {} mm", side[0], side[1]));
  wish.pore_width_mm = side[0];
  wish.pore_length_mm = side[1];
  return {};
}

/// errors  kUsage
Result<segment::PoreWish> read_pore_wish(const Arguments& arguments) {
  segment::PoreWish wish;
  double porosity = 0, darcy = 0;
  for (const Status& status : {arguments.read("--porosity", {0.1, 99, " %"}, porosity),
                               arguments.read("--permeability", {1e-3, 1e6, " D"}, darcy), read_pore(arguments, wish)}) {
    if (!status) return status.error();
  }
  if (porosity > 0) wish.porosity = porosity / 100;
  if (darcy > 0) wish.permeability_m2 = darcy * segment::kDarcy;
  const int wishes = (porosity > 0) + (darcy > 0) + wish.pore_width_mm.has_value();
  if (wishes == 0) return Error{Fault::kUsage, "nothing is wished for; give --porosity, --permeability or --pore"};
  if (wishes == 3)
    return Error{Fault::kUsage, "--porosity, --permeability and --pore are more than a filling can follow; leave one out"};
  return wish;
}

std::string design_text(const DesignedJob& found) {
  const segment::Settings& keys = found.design.settings;
  const ForwardRun& forward = found.forward;
  std::string text = fmt::format(
      "lines     thick {:g} mm, thin {:g} mm, {} continuous line{} between segmented ones, S-C {:g}, C-C {:g} mm\n"
      "laid at   {:g} % extrusion, thick {:g} %, thin {:g} % of the speed\n",
      keys.thick_mm, keys.thin_mm, keys.continuous, keys.continuous == 1 ? "" : "s", *keys.spacing_sc_mm, *keys.spacing_cc_mm,
      keys.thick_extrusion, *keys.thick_speed, keys.thin_speed);
  text += fmt::format("porosity  {:.2f} %, {:.2f} % leads through along z\n", 100 * forward.porosity,
                      100 * forward.porosity_through);
  text +=
      fmt::format("along z   k1 {:.4g} +- {:.2g} D ({:.4e} m2), throat {:.3f} mm\n", forward.permeability_m2 / segment::kDarcy,
                  forward.permeability_error_m2 / segment::kDarcy, forward.permeability_m2, found.design.slots.throat_mm);
  text += fmt::format("pores     {:.3f} x {:.2f} mm\n", forward.pore_width_mm, forward.pore_length_mm);
  text +=
      "sure      +- is of the voxels; plans of this kind have lain within a factor of 1.5 of measured k1, 2.5 points of\n"
      "          measured porosity (bench/pores.md)\n";
  if (!found.widths.empty()) text += fmt::format("widths    {}\n", found.widths);
  if (!forward.resolved) text += "note      voxels are too coarse for the pores; take a smaller --voxel\n";
  for (const std::string& line : found.outside) text += fmt::format("beyond    {}\n", line);
  if (found.outside.empty()) text += "beyond    nothing: lengths, gaps and extrusion are those that were measured\n";
  return text + fmt::format("checked   by {} forward run{}; the wish is met within {:.1f} %\n", found.runs,
                            found.runs == 1 ? "" : "s", 100 * found.miss);
}

Json design_json(const DesignedJob& found, const std::string& output) {
  const segment::Settings& keys = found.design.settings;
  const ForwardRun& forward = found.forward;
  return {{"command", "design"},
          {"met", found.met},
          {"miss", found.miss},
          {"job", output},
          {"segment",
           {{"thick_mm", keys.thick_mm},
            {"thin_mm", keys.thin_mm},
            {"continuous_lines", keys.continuous},
            {"spacing_sc_mm", *keys.spacing_sc_mm},
            {"spacing_cc_mm", *keys.spacing_cc_mm},
            {"thick_extrusion_percent", keys.thick_extrusion},
            {"thick_speed_percent", *keys.thick_speed},
            {"thin_speed_percent", keys.thin_speed}}},
          {"porosity", forward.porosity},
          {"porosity_through", forward.porosity_through},
          {"k1_darcy", forward.permeability_m2 / segment::kDarcy},
          {"k1_error_darcy", forward.permeability_error_m2 / segment::kDarcy},
          {"k1_m2", forward.permeability_m2},
          {"resolved", forward.resolved},
          {"throat_mm", found.design.slots.throat_mm},
          {"pore_mm", {forward.pore_width_mm, forward.pore_length_mm}},
          {"runs", found.runs},
          {"k1_over_slots", found.model_ratio},
          {"widths", found.widths},
          {"beyond_measured", found.outside}};
}

/// What the nearest is, of what was wished.
std::string nearest_text(const segment::PoreWish& wish, const DesignedJob& found) {
  const ForwardRun& forward = found.forward;
  std::string text;
  const auto add = [&](bool wished, const std::string& part) {
    if (wished) text += (text.empty() ? "" : ", ") + part;
  };
  add(wish.porosity.has_value(), fmt::format("--porosity {:.2f}", 100 * forward.porosity));
  add(wish.permeability_m2.has_value(), fmt::format("--permeability {:.4g}", forward.permeability_m2 / segment::kDarcy));
  add(wish.pore_width_mm.has_value(), fmt::format("--pore {:.3f}x{:.2f}", forward.pore_width_mm, forward.pore_length_mm));
  return text;
}

Outcome run_design(const Arguments& arguments, Context& context) {
  if (!arguments.has("--machine"))
    return Error{Fault::kUsage, "--machine is missing; name an extrusion printer, as lamina extrude takes it"};
  const auto wish = read_pore_wish(arguments);
  if (!wish) return wish.error();
  DesignRequest request;
  request.machine = arguments.text("--machine");
  request.wish = *wish;
  double voxel = 10;
  if (const Status status = arguments.read("--voxel", {1, 50, " um"}, voxel); !status) return status;
  request.grid = {voxel, 2 * voxel, voxel, request.grid.places};
  const std::string output = arguments.text("-o,--output");
  const std::atomic<bool>& cancel = context.cancel();
  keep_on_signals();
  const auto found = design_job(request, [&](double) { return !cancel; });
  if (!found) return found.error();
  if (!arguments.has("--quiet")) context.say_text(design_text(*found));
  const bool written = !output.empty() && (found->met || arguments.has("--nearest"));
  if (written) {
    if (const Status status = write::write_file(output, found->toml); !status) return status;
  }
  if (arguments.has("--json")) {
    if (const Status status = context.give(design_json(*found, written ? output : "")); !status) return status;
  }
  if (found->met || arguments.has("--nearest")) return {};
  return Error{Fault::kVerification,
               fmt::format("not reachable: nearest is {}, which misses the wish by {:.0f} %; write it with "
                           "--nearest",
                           nearest_text(*wish, *found), 100 * found->miss)};
}

}  // namespace

const Command design_command = {"design", "the filling whose pores, porosity or permeability are as wished, as a job file",
                                design_spec, run_design};

}  // namespace lamina::pipeline
