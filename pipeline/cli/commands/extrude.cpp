#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/job/file.h"
#include "pipeline/machine/extruder.h"
#include "pipeline/run/run.h"

namespace lamina::pipeline {
namespace {

const KeyChoice kExtrudeKeys = {
    "layers",     "heights",     "place",      "machine.profile", "fill", "segment", "extrude", "load", "slice.tolerance_um",
    "run.output", "run.threads", "run.memory", "run.layers",      "part"};

CommandSpec extrude_spec() {
  CommandSpec spec;
  spec.summary =
      "Plans parts for a material extrusion printer: walls, filling and segmented lines as G-code or SML, with what the\n"
      "pores will be. The same parts and options give the same bytes.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files, STL and OBJ gzipped too; they replace the parts of --job";
  add_key_options(kExtrudeKeys, spec);
  for (const auto& [flag, meaning] : {std::pair{"--resume", "go on with an interrupted job: whole layers are kept"},
                                      {"--overwrite", "replace an earlier file"},
                                      {"--dry-run", "load, place and index, predict, write nothing"},
                                      {"--json", "print the summary as one JSON object on stdout"},
                                      {"--quiet", "say nothing but errors"}}) {
    spec.options.push_back({flag, "", meaning, "", "Run"});
  }
  spec.absent = {{"--shard", kNoShards}};
  spec.closing = "Machines:\n";
  for (const ShippedExtruder& shipped : shipped_extruders()) {
    const auto profile = read_extruder(shipped.text, std::string(shipped.name));
    spec.closing += fmt::format("  {:<16}{}\n", shipped.name, profile ? profile->machine.description : "");
  }
  spec.closing +=
      "\nWithout a job file one wall is laid and layers are half of the nozzle thick. Lengths are mm, angles degrees.\n"
      "docs/extrude.md has the profiles and the file formats, docs/segmented.md the segmented filling.\n\n"
      "Examples:\n"
      "  lamina extrude bracket.stl --machine marlin --layer 0.2 --walls 2 --fill raster --bead-gap 1 -o bracket.gcode\n"
      "  lamina extrude part.stl --machine anet-a8 --layer 0.3 --fill segmented --angle 90 --angle-step 0 -o part.gcode\n"
      "  lamina extrude part.stl --machine anet-a8 --layer 0.3 --fill segmented --extrusion 125 --thin 2 -o part.gcode\n"
      "  lamina extrude part.stl --machine fdm-2000 --layer 0.254 --bead 0.508 --fill raster -o part.sml";
  return spec;
}

bool sets(const Arguments& arguments, std::string_view key) {
  return std::ranges::any_of(arguments.all("--set"), [&](const std::string& text) { return text.starts_with(key); });
}

Outcome run_command(const Arguments& arguments, Context& context) {
  Result<Job> read = read_job_options(kExtrudeKeys, arguments);
  if (!read) return read.error();
  Job& job = *read;
  job.resume = arguments.has("--resume");
  job.overwrite = arguments.has("--overwrite");
  job.dry_run = arguments.has("--dry-run");
  job.json = arguments.has("--json");
  job.quiet = arguments.has("--quiet");
  if (!arguments.has("--job")) {
    // A job file says everything; a command line may leave to the printer what a powder job has other defaults for.
    const auto profile = resolve_extruder(job);
    if (!profile) return profile.error();
    if (!arguments.has("--walls") && !sets(arguments, "fill.walls")) job.fill.all.walls = 1;
    if (!arguments.has("--layer") && !sets(arguments, "layers.thickness_mm") && !sets(arguments, "heights.") &&
        !arguments.has("--thickness")) {
      job.layer_mm = profile->machine.format == "sml" && !profile->machine.sml.pd.empty()
                         ? profile->machine.sml.pd.front().thickness_mm
                         : profile->machine.material.nozzle_mm / 2;
    }
  }
  if (job.segment.all.on && job.fill.all.pattern == infill::Pattern::kNone) job.fill.all.pattern = infill::Pattern::kRaster;
  if (job.output.empty() && !job.dry_run)
    return Error{Fault::kUsage, "-o FILE is missing; name the file for the toolpaths, or use --dry-run"};
  std::error_code ignored;
  if (std::filesystem::is_directory(job.output, ignored)) {
    return Error{Fault::kUsage, fmt::format("-o {}: is a directory; name a file in it, as in {}", job.output,
                                            (std::filesystem::path(job.output) / "part.gcode").string())};
  }
  if (Status status = check_job(job); !status) return status.error();
  if (arguments.has("--save-job")) {
    if (Status status = save_job(arguments.text("--save-job"), job); !status) return status.error();
  }
  const Result<Summary> summary = run(
      job, Product::kMoves, [&](const ProgressEvent& event) { context.progress(event); }, context.cancel());
  if (!summary) return summary.error();
  if (!job.quiet) context.say_text(summary->text());
  if (job.json) {
    if (Status status = context.print(summary->json()); !status) return status.error();
  }
  Outcome outcome;
  outcome.layers_planned = summary->layers_planned;
  outcome.layers_kept = summary->layers_kept;
  return outcome;
}

}  // namespace

const Command extrude_command = {"extrude",
                                 "material extrusion: toolpaths as G-code or SML, with segmented lines and their pores",
                                 extrude_spec, run_command};

}  // namespace lamina::pipeline
