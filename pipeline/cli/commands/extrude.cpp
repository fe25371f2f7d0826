#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/cli/plan_command.h"
#include "pipeline/machine/extruder.h"

namespace lamina::pipeline {
namespace {

const KeyChoice kKeys = {
    "layers",     "heights",     "place",      "machine.profile", "fill", "segment", "extrude", "load", "slice.tolerance_um",
    "run.output", "run.threads", "run.memory", "run.layers",      "part"};

const OptionSpec kOwn[] = {{"--resume", "", "go on with an interrupted job: whole layers are kept", "", "Run"},
                           {"--overwrite", "", "replace an earlier file", "", "Run"},
                           {"--dry-run", "", "load, place and index, predict, write nothing", "", "Run"}};

const OptionSpec kOverrides[] = {{"-o,--output", "FILE", "file for the toolpaths, as in part.gcode or part.sml", "", ""},
                                 {"--machine", "", "extrusion printer: one of those below, or a profile as TOML", "marlin", ""},
                                 {"--layer", "", "", "half of the nozzle; in a job file 0.05", ""},
                                 {"--walls", "", "", "1; in a job file 0", ""}};

std::string closing() {
  std::string text = "Machines:\n";
  for (const ShippedExtruder& shipped : shipped_extruders()) {
    const auto profile = read_extruder(shipped.text, std::string(shipped.name));
    text += fmt::format("  {:<16}{}\n", shipped.name, profile ? profile->machine.description : "");
  }
  return text +
         "\nWithout a job file one wall is laid and layers are half of the nozzle thick. Lengths are mm, angles degrees.\n"
         "docs/extrude.md has the profiles and the file formats, docs/segmented.md the segmented filling.\n\n"
         "Examples:\n"
         "  lamina extrude bracket.stl --machine marlin --layer 0.2 --walls 2 --fill raster --bead-gap 1 -o bracket.gcode\n"
         "  lamina extrude part.stl --machine anet-a8 --layer 0.3 --fill segmented --angle 90 --angle-step 0 -o part.gcode\n"
         "  lamina extrude part.stl --machine anet-a8 --layer 0.3 --fill segmented --extrusion 125 --thin 2 -o part.gcode\n"
         "  lamina extrude part.stl --machine fdm-2000 --layer 0.254 --bead 0.508 --fill raster -o part.sml";
}

bool sets(const Arguments& arguments, std::string_view key) {
  return std::ranges::any_of(arguments.all("--set"), [&](const std::string& text) { return text.starts_with(key); });
}

/// A job file says everything; a command line leaves to the printer what a powder job has other defaults for.
Status set_defaults(const Arguments& arguments, Job& job) {
  const auto profile = resolve_extruder(job);
  if (!profile) return profile.error();
  const Extruder& machine = profile->machine;
  if (!arguments.has("--walls") && !sets(arguments, "fill.walls")) job.fill.all.walls = 1;
  if (!arguments.has("--layer") && !sets(arguments, "layers.thickness_mm") && !sets(arguments, "heights.") &&
      !arguments.has("--thickness")) {
    job.layer_mm = machine.format == "sml" && !machine.sml.pd.empty() ? machine.sml.pd.front().thickness_mm
                                                                      : machine.material.nozzle_mm / 2;
  }
  return {};
}

Status resolve(const Arguments& arguments, Job& job) {
  if (!arguments.has("--job")) {
    if (Status status = set_defaults(arguments, job); !status) return status;
  }
  if (job.segment.all.on && job.fill.all.pattern == infill::Pattern::kNone) job.fill.all.pattern = infill::Pattern::kRaster;
  if (job.output.empty() && !job.dry_run) {
    return Error{Fault::kUsage, "-o FILE is missing; name the file for the toolpaths, or use --dry-run"};
  }
  std::error_code ignored;
  if (!std::filesystem::is_directory(job.output, ignored)) return {};
  return Error{Fault::kUsage, fmt::format("-o {}: is a directory; name a file in it, as in {}", job.output,
                                          (std::filesystem::path(job.output) / "part.gcode").string())};
}

/// Of the file that a batch names after its part.
std::string ending(const Arguments& arguments) {
  Job job;
  job.machine.profile = arguments.text("--machine");
  const auto profile = resolve_extruder(job);
  return profile && profile->machine.format == "sml" ? ".sml" : ".gcode";
}

PlanCommand row() {
  return {Product::kMoves,
          kKeys,
          "Plans parts for a material extrusion printer: walls, filling and segmented lines as G-code or SML, with what the\n"
          "pores will be. The same parts and options give the same bytes.",
          kOwn,
          kOverrides,
          closing(),
          false,
          resolve};
}

}  // namespace

const Command extrude_command = {"extrude",
                                 "material extrusion: toolpaths as G-code or SML, with segmented lines and their pores",
                                 [] { return plan_spec(row()); },
                                 [](const Arguments& arguments, Context& context) { return plan(row(), arguments, context); },
                                 false,
                                 ending};

}  // namespace lamina::pipeline
