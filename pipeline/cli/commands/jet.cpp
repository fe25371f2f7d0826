#include <fmt/format.h>

#include "pipeline/cli/command.h"
#include "pipeline/cli/keys.h"
#include "pipeline/job/file.h"
#include "pipeline/machine/materials.h"
#include "pipeline/machine/powder_printer.h"
#include "pipeline/run/run.h"
#include "pipeline/text/number_text.h"
#include "stages/write/image_format.h"

namespace lamina::pipeline {
namespace {

// clang-format off
const KeyChoice kJetKeys = {"bed", "layers", "heights", "place", "image.format", "image.mirror", "machine", "dose", "fill", "segment.fill",
                            "segment.rule", "segment.thick_mm", "segment.thin_mm", "segment.continuous_lines", "segment.spacing_sc_mm",
                            "segment.spacing_cc_mm", "segment.gap_mm", "segment.shift_mm", "segment.thick_width_mm",
                            "segment.thin_width_mm", "load", "run", "part"};
// clang-format on

CommandSpec jet_spec() {
  CommandSpec spec;
  spec.summary =
      "Plans a binder-jet job: the exact 1-bit image of every layer of the bed, layers/000000.tif and up from the\n"
      "bottom, and a manifest.json. The same parts and options give the same bytes on every machine.";
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files, STL and OBJ gzipped too; they replace the parts of --job";
  add_key_options(kJetKeys, spec);
  spec.options.push_back({"--material", "NAME|NAME,...",
                          "powder of all parts, or of each in their order; two vats can hold two", "", "Machine and binder"});
  for (const auto& [flag, meaning] :
       {std::pair{"--resume", "go on with an interrupted job; finished layers whose hash holds are kept"},
        {"--overwrite", "replace an earlier job in the directory"},
        {"--dry-run", "load, place and index, tell what it would take, write nothing"},
        {"--json", "print the summary as one JSON object on stdout"},
        {"--quiet", "say nothing but errors"}}) {
    spec.options.push_back({flag, "", meaning, "", "Run"});
  }
  spec.closing = "Formats:\n";
  for (const auto& format : write::image_formats()) {
    spec.closing += fmt::format("  {:<16}{}\n", format.id, format.description);
  }
  spec.closing +=
      "\nLengths are mm, angles degrees. Part options hold for every part; a job file sets them for each.\n\n"
      "Examples:\n"
      "  lamina jet bracket.stl -o out                                  a part in the middle of the bed\n"
      "  lamina jet a.stl b.3mf --bed 400x400 --dpi 600 --copies 12 -o out\n"
      "  lamina jet part.obj --unit inch --rotate 0,0,90 --shrink 1.02,1.02,1.025 -o out\n"
      "  lamina jet a.stl b.stl --material steel,bronze --machine nuferbj -o out\n"
      "  lamina jet part.stl --layers 100:110 --format png -o look      ten layers only\n"
      "  lamina jet part.stl --shard 1/4 -o out                         a quarter; then lamina merge out -o out\n"
      "  lamina jet part.stl --fill segmented --thin 1.5 --shell 1 -o out   pores planned by the filling, in a solid shell\n"
      "  lamina jet part.stl --dpi 600 --save-job job.toml --dry-run    write the job, plan nothing\n"
      "  lamina jet --job job.toml -o out --resume";
  return spec;
}

Result<Job> resolve(const Arguments& arguments) {
  Result<Job> read = read_job_options(kJetKeys, arguments);
  if (!read) return read;
  Job& job = *read;
  if (arguments.has("--material")) {
    if (Status status = set_materials(arguments.text("--material"), job); !status) {
      return Error{Fault::kUsage, "--material: " + status.error().message};
    }
  }
  job.resume = arguments.has("--resume");
  job.overwrite = arguments.has("--overwrite");
  job.dry_run = arguments.has("--dry-run");
  job.json = arguments.has("--json");
  job.quiet = arguments.has("--quiet");
  if (Status status = check_job(job); !status) return status.error();
  if (Status status = resolve_machine(job); !status) return status.error();
  return read;
}

Outcome run_command(const Arguments& arguments, Context& context) {
  const Result<Job> job = resolve(arguments);
  if (!job) return job.error();
  if (arguments.has("--save-job")) {
    if (Status status = save_job(arguments.text("--save-job"), *job); !status) return status.error();
  }
  const Result<Summary> summary = run(
      *job, Product::kImages, [&](const ProgressEvent& event) { context.progress(event); }, context.cancel());
  if (!summary) return summary.error();
  if (!job->quiet) context.say_text(summary->text());
  if (job->json) {
    if (Status status = context.print(summary->json()); !status) return status.error();
  }
  Outcome outcome;
  outcome.layers_planned = summary->layers_planned;
  outcome.layers_kept = summary->layers_kept;
  return outcome;
}

}  // namespace

const Command jet_command = {"jet", "binder jetting: exact 1-bit images of every layer of the bed, and a manifest", jet_spec,
                             run_command};

}  // namespace lamina::pipeline
