#include <fmt/format.h>

#include "pipeline/check/job_files.h"
#include "pipeline/cli/command.h"
#include "pipeline/job/errors.h"
#include "pipeline/output/merge.h"
#include "pipeline/report/summary.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec merge_spec() {
  CommandSpec spec;
  spec.summary =
      "Joins the shards of a job, from one or several directories, into the directory of a job that was never divided:\n"
      "its manifest.json is the same byte for byte. Layers are linked, or copied to another file system.";
  spec.operand = "DIR";
  spec.operand_meaning = "directories that lamina jet --shard or --layers wrote";
  spec.options = {{"-o,--output", "OUT", "directory of the whole job; may be one of DIR", "", ""},
                  {"--strict", "", "warnings are errors: exit 5, and nothing is joined", "", ""},
                  {"--allow-empty", "", "join a whole job without any pixel", "", ""},
                  {"--json", "", "print one JSON object on stdout", "", ""},
                  {"--quiet", "", "print errors only", "", ""}};
  spec.closing =
      "Examples:\n"
      "  for i in 1 2 3 4; do lamina jet part.stl --shard $i/4 -o out; done; lamina merge out -o out\n"
      "  lamina merge machine-a/out machine-b/out -o whole && lamina verify whole";
  return spec;
}

Outcome run_merge(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return usage("no directory to merge; name those of the shards");
  const std::string output = arguments.text("-o,--output");
  if (output.empty()) return usage("-o OUT is missing; name the directory of the whole job");
  const Result<MergeReport> report =
      merge({arguments.operands, output, arguments.has("--strict"), arguments.has("--allow-empty")});
  if (!report) return report.error();
  if (!arguments.has("--quiet") && report->shards == 0) {
    context.say(fmt::format("{}: is whole already, {} layers, nothing is left to merge", report->output,
                            readable_count(report->layers)));
  } else if (!arguments.has("--quiet")) {
    context.say(fmt::format("{}: {} layers of {} shards joined, {} files linked, {} copied", report->output,
                            readable_count(report->layers), report->shards, report->linked, report->copied));
  }
  const auto whole = read_manifest(report->output + "/manifest.json");
  const std::string sweeps = whole ? sweeps_of_job(report->output, *whole) : std::string();
  if (!arguments.has("--quiet")) {
    if (!sweeps.empty()) context.say("sweeps: " + sweeps);
    for (const Warning& warning : report->warnings) context.say("warning: " + one_line(warning.text));
  }
  if (!arguments.has("--json")) return {};
  Json reported = {{"command", "merge"},       {"directory", report->output}, {"shards", report->shards},
                   {"layers", report->layers}, {"linked", report->linked},    {"copied", report->copied}};
  if (report->microseconds > 0) reported["print_seconds"] = 1e-6 * static_cast<double>(report->microseconds);
  if (!sweeps.empty()) reported["sweeps"] = sweeps;
  reported["warnings"] = warnings_json(report->warnings);
  return context.give(reported);
}

}  // namespace

const Command merge_command = {"merge", "join the shards of a job that was divided", merge_spec, run_merge};

}  // namespace lamina::pipeline
