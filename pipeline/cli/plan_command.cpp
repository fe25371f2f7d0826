#include "pipeline/cli/plan_command.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/job/file.h"
#include "pipeline/plan/plan.h"
#include "pipeline/run/run.h"
#include "pipeline/text/json.h"

namespace lamina::pipeline {
namespace {

Result<Job> read_plan(const PlanCommand& row, const Arguments& arguments) {
  Result<Job> job = read_job_options(row.keys, arguments);
  if (!job) return job;
  job->resume = arguments.has("--resume");
  job->overwrite = arguments.has("--overwrite");
  job->dry_run = arguments.has("--dry-run");
  job->json = arguments.has("--json");
  job->quiet = arguments.has("--quiet");
  if (Status status = row.resolve(arguments, *job); !status) return status.error();
  if (Status status = check_job(*job); !status) return status.error();
  return job;
}

/// Words of a row instead of those of the key.
void override_words(std::span<const OptionSpec> overrides, CommandSpec& spec) {
  for (const OptionSpec& other : overrides) {
    const auto option = std::ranges::find(spec.options, other.flag, &OptionSpec::flag);
    if (!other.value.empty()) option->value = other.value;
    if (!other.meaning.empty()) option->meaning = other.meaning;
    if (!other.preset.empty()) option->preset = other.preset;
  }
}

}  // namespace

CommandSpec plan_spec(const PlanCommand& row) {
  CommandSpec spec;
  spec.summary = row.summary;
  spec.operand = "PART";
  spec.operand_meaning = "STL, OBJ or 3MF files, STL and OBJ gzipped too; they replace the parts of --job";
  add_key_options(row.keys, spec);
  override_words(row.overrides, spec);
  if (!row.divided) spec.absent = {{"--shard", kNoShards}};
  spec.options.insert(spec.options.end(), row.own.begin(), row.own.end());
  spec.options.push_back({"--json", "", "print the summary as one JSON object on stdout", "", "Run"});
  spec.options.push_back({"--quiet", "", "say nothing but errors", "", "Run"});
  spec.closing = row.closing;
  return spec;
}

Outcome plan(const PlanCommand& row, const Arguments& arguments, Context& context) {
  const Result<Job> job = read_plan(row, arguments);
  if (!job) return job.error();
  say_notes(*job, context);
  if (arguments.has("--save-job")) {
    const Result<Resolved> resolved = resolve(*job, row.product);
    if (!resolved) return resolved.error();
    if (Status status = save_job(arguments.text("--save-job"), resolved->job); !status) return status.error();
  }
  const auto progress = [&](const ProgressEvent& event) { context.progress(event); };
  const Result<Summary> summary = run(*job, row.product, progress, context.cancel());
  if (!summary) return summary.error();
  if (!job->quiet) context.say_text(summary->text());
  if (job->json) {
    if (Status status = context.give(Json::parse(summary->json())); !status) return status.error();
  }
  Outcome outcome;
  outcome.layers_planned = summary->layers_planned;
  outcome.layers_kept = summary->layers_kept;
  return outcome;
}

}  // namespace lamina::pipeline
