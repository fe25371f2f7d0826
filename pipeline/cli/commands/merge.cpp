#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "pipeline/batch/shares.h"
#include "pipeline/batch/whole.h"
#include "pipeline/check/job_files.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/job/errors.h"
#include "pipeline/report/summary.h"
#include "pipeline/run/merge.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec merge_spec() {
  CommandSpec spec;
  spec.summary =
      "Merges the shards of a job, from one or several directories, into the directory of the whole job. Its manifest.json\n"
      "is identical to that of an undivided job. Layers are linked, or copied to another file system. Shares of a batch are\n"
      "merged in its directory; the exit code is that of the batch, or 5 while a share is missing.";
  spec.operand = "DIR";
  spec.operand_meaning = "directories written by lamina jet with --shard or --layers, or one of lamina batch with --shard";
  spec.options = {{"-o,--output", "OUT", "directory of the whole job; may be one of DIR", "", ""},
                  {"--strict", "", "treat warnings as errors: exit code 5, no output", "", ""},
                  {"--allow-empty", "", "accept a job without any pixel", "", ""},
                  {"--json", "", "print the result as one JSON object on stdout", "", ""},
                  {"--quiet", "", "print errors only", "", ""}};
  spec.closing =
      "Examples:\n"
      "  for i in 1 2 3 4; do lamina jet part.stl --shard $i/4 -o out; done; lamina merge out -o out\n"
      "  lamina merge machine-a/out machine-b/out -o whole && lamina verify whole\n"
      "  for i in 1 2 3 4; do lamina batch jobs.txt -o out --shard $i/4; done; lamina merge out";
  return spec;
}

/// Merges the shares of a batch in its directory. returns  the exit code of the batch
Outcome merge_batch(const Arguments& arguments, Context& context) {
  const std::string& directory = arguments.operands.front();
  if (arguments.operands.size() > 1) return usage("{}: is the directory of a batch; merge it by itself", directory);
  for (const char* option : {"--strict", "--allow-empty"}) {
    if (arguments.has(option)) return at_option(option, "is of shards of a job, and " + directory + " is of a batch");
  }
  if (arguments.has("-o,--output") && !same_file(arguments.text("-o,--output"), directory))
    return at_option("-o,--output", "a batch is merged in its own directory; remove -o or give " + directory);
  std::optional<File> plan;  // a share that starts waits until it is merged
  if (has_shares(directory)) {
    Result<File> locked = lock_plan(directory);
    if (!locked) return locked.error();
    plan.emplace(std::move(*locked));
  }
  const Result<BatchDirectory> batch = read_batch_directory(directory);
  if (!batch) return batch.error();
  Faults missing;
  for (const std::string& line : missing_lines(*batch)) missing.add(line);
  complain_of(missing, directory, context);
  if (!missing.ok()) return static_cast<int>(Fault::kVerification);
  keep_on_signals();
  if (batch->shares > 0) {
    if (Status merged = merge_shares(*batch, kJsonSchema, {.follow = false}, context.cancel()); !merged) return merged;
  }
  plan.reset();  // a share that waits ends, for it finds no plan
  if (Status removed = remove_merged_shares(directory); !removed) return removed;
  if (!arguments.has("--quiet")) {
    context.say(batch->shares > 0 ? fmt::format("{}: {} jobs of {} shares joined", directory, batch->jobs.size(), batch->shares)
                                  : fmt::format("{}: is whole already, {} jobs", directory, batch->jobs.size()));
  }
  if (arguments.has("--json")) {
    const Json reported = {{"command", "merge"},
                           {"directory", directory},
                           {"shards", batch->shares},
                           {"jobs", batch->jobs.size()},
                           {"code", batch->code()}};
    if (Status status = context.give(reported); !status) return status;
  }
  return batch->code();
}

Outcome run_merge(const Arguments& arguments, Context& context) {
  if (arguments.operands.empty()) return usage("no directory to merge; name those of the shards");
  if (std::ranges::any_of(arguments.operands, is_batch_directory)) return merge_batch(arguments, context);
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
  if (report->microseconds > 0) reported["print_seconds"] = static_cast<double>(report->microseconds) / 1e6;
  if (!sweeps.empty()) reported["sweeps_text"] = sweeps;
  reported["warnings"] = warnings_json(report->warnings);
  return context.give(reported);
}

}  // namespace

const Command merge_command = {"merge", "join the shards of a divided job", merge_spec, run_merge};

}  // namespace lamina::pipeline
