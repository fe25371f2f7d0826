#include <fmt/format.h>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/cli/outputs.h"
#include "pipeline/job/file.h"
#include "pipeline/run/run.h"

namespace lamina::pipeline {
namespace {

const KeyChoice kSliceKeys = {"bed.size_mm", "layers",     "heights",    "place", "image.fill", "load", "run.output",
                              "run.threads", "run.memory", "run.layers", "slice", "fill",       "part"};

CommandSpec slice_spec() {
  CommandSpec spec;
  spec.summary =
      "Cuts parts into layers: closed contours in exact nanometres, outer ones counter-clockwise, holes clockwise, as\n"
      "SVG, CLI or 3MF slices, and fills them if a pattern or walls are asked for.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files, STL and OBJ gzipped too; they replace the parts of --job";
  add_key_options(kSliceKeys, spec);
  spec.absent = {{"--shard", kNoShards}};
  for (const auto& [flag, meaning] : {std::pair{"--resume", "go on with an interrupted job: whole layers are kept"},
                                      {"--overwrite", "replace an earlier job in the directory"},
                                      {"--dry-run", "load, place and index, write nothing"},
                                      {"--json", "print the summary as one JSON object on stdout"},
                                      {"--quiet", "say nothing but errors"}}) {
    spec.options.push_back({flag, "", meaning, "", "Run"});
  }
  spec.closing =
      "Lengths are mm, angles degrees. Keys of a filling that have no option are set by --set fill.KEY=VALUE, between\n"
      "heights by fill.by_height, for one part by part.fill; docs/filling.md has all of them.\n\n"
      "Examples:\n"
      "  lamina slice bracket.stl --layer 0.1 -o out                      out/bracket.svg\n"
      "  lamina slice bracket.stl --layer 0.05 --format cli-binary -o out\n"
      "  lamina slice a.stl b.stl --layer 0.2 --format 3mf -o out\n"
      "  lamina slice part.stl --layer 0.3 --walls 1 --pattern raster --bead 0.4 --bead-gap 0.12 --angle 90 -o out\n"
      "  lamina slice part.stl --layer 0.3 --pattern raster --stagger 0,0.26 --gap-formula '0.1+0.6*h' -o out";
  return spec;
}

Outcome run_command(const Arguments& arguments, Context& context) {
  Result<Job> read = read_job_options(kSliceKeys, arguments);
  if (!read) return read.error();
  Job& job = *read;
  job.resume = arguments.has("--resume");
  job.overwrite = arguments.has("--overwrite");
  // A sliced job keeps its job beside its manifest.
  const InputFile asked = {arguments.text("--job"), "the job file"};
  const std::string kept = job.output + "/job.toml";
  if (Status status = check_outputs({&asked, 1}, {&kept, 1}); !status) return status.error();
  job.dry_run = arguments.has("--dry-run");
  job.json = arguments.has("--json");
  job.quiet = arguments.has("--quiet");
  if (Status status = check_job(job); !status) return status.error();
  if (arguments.has("--save-job")) {
    if (Status status = save_job(arguments.text("--save-job"), job); !status) return status.error();
  }
  const Result<Summary> summary = run(
      job, Product::kContours, [&](const ProgressEvent& event) { context.progress(event); }, context.cancel());
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

const Command slice_command = {"slice", "contours of every layer, and their filling: SVG, CLI, 3MF slices", slice_spec,
                               run_command};

}  // namespace lamina::pipeline
