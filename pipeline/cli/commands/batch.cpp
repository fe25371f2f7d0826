#include <fmt/format.h>
#include <tbb/info.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>

#include "pipeline/batch/queue.h"
#include "pipeline/batch/summary.h"
#include "pipeline/batch/whole.h"
#include "pipeline/cache/store.h"
#include "pipeline/cli/batch_shares.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/job_call.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/keys.h"
#include "stages/load/load.h"
#include "stages/load/part_store.h"
#include "stages/support/io/file.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/json_value.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/terminal.h"

namespace lamina::pipeline {
namespace {

constexpr std::uint64_t kMinBatchBytes = 48ull << 20;  // the layers of one job, and its other memory

CommandSpec batch_spec() {
  CommandSpec spec;
  const auto sync = std::ranges::find(job_keys(), "--sync", &JobKey::flag);
  spec.summary =
      "Runs many jobs in one queue that shares the processors and a memory budget. Results and errors are recorded in\n"
      "DIR/summary.json and DIR/summary.tsv. A failed job does not stop the others; --resume continues a batch.";
  spec.operand = "LIST";
  spec.operand_meaning =
      "job lists (one command per line, as in jet part.stl --dpi 600 -o part), directories of parts and job files, parts, or "
      "TOML job files";
  spec.options = {
      {"-o,--output", "DIR", "output directory of the batch; jobs write below it", "", ""},
      {"--with", "WORDS", "command and options for parts, as in --with 'jet --dpi 600'", "jet", ""},
      {"--jobs", "N", "max number of concurrent jobs; 0: one per processor", "0", "Run"},
      {"--memory", "SIZE", "memory limit of all running jobs: 512M, 4G", "1G", "Run"},
      {"--sync", "WHEN", "when files are flushed to disk: job (at its end), layer or off", "job", "Run", sync->words()},
      {"--container", "KIND", "--container of jobs of images that set none: zip, tiff", "none", "Run", {"none", "zip", "tiff"}},
      {"--cache", "FOLDER", "take the files of equal jobs from a cache, or add them", "", "Run"},
      {"--cache-link", "", "make read-only hard links to the cache, no copies", "", "Run"},
      {"--time-limit", "SECONDS", "time limit per job in seconds; slower jobs fail with exit code 3", "", "Run"},
      {"--keep-going", "", "continue after a failed job (default)", "", "Run"},
      {"--fail-fast", "", "stop the batch at the first failed job", "", "Run"},
      {"--resume", "", "continue a batch in DIR; finished jobs with valid files are kept", "", "Run"},
      {"--overwrite", "", "replace an earlier batch in DIR", "", "Run"},
      {"--shard", "I/N", "run share I of N of the jobs, I from 1; see lamina merge", "", "Shares"},
      {"--plan-shares", "N", "plan N shares by dry runs in DIR/shares.tsv; run no job", "", "Shares"},
      {"--status", "", "print the progress of the batch in directory LIST", "", "Shares"},
      progress_option(),
      {"--json", "", "print the result as one JSON object on stdout", "", "Run"},
      {"--quiet", "", "print errors only, one line per failed job", "", "Run"}};
  spec.closing =
      "A job is any command but batch and preview. -o of a job is below the batch's DIR; without one a job is called as its\n"
      "first file. Other paths are as on the command line. Jobs begin in order and must not need each other's results.\n\n"
      "Examples:\n"
      "  lamina batch parts/ -o out                                  lamina jet of every part\n"
      "  lamina batch parts/ --with 'jet --dpi 600 --format png' --jobs 4 --memory 8G -o out\n"
      "  lamina batch jobs.txt night/*.toml -o out --time-limit 3600\n"
      "  lamina batch jobs.txt -o out --resume\n"
      "  lamina batch jobs.txt -o out --shard 2/4                    a quarter; lamina merge out when all are done\n"
      "  lamina batch out --status\n"
      "  lamina batch parts/ --with info -o checked && jq -r '.jobs[] | [.source, .result.closed] | @tsv' checked/summary.json";
  return spec;
}

// --- the command

/// The settings from the options, and the default words for parts. errors  kUsage
Result<BatchOptions> read_options(const Arguments& arguments, std::vector<std::string>& words) {
  BatchOptions options;
  if (arguments.operands.empty()) return usage("no jobs; name a list, a directory of parts, or TOML job files");
  options.directory = arguments.text("-o,--output");
  if (options.directory.empty()) return usage("-o DIR is missing; name the directory of the batch");
  const auto with = split_words(arguments.has("--with") ? arguments.text("--with") : "jet");
  if (!with) return at_option("--with", with.error().message).error();
  if (with->empty()) return at_option("--with", "no command; as in --with 'jet --dpi 600'").error();
  words = *with;
  options.jobs = 0;
  for (const Status& status :
       {arguments.read("--jobs", {0, 1024}, options.jobs), arguments.read("--memory", read_bytes, options.memory_bytes),
        arguments.read("--time-limit", {0.001, 1e9, " s"}, options.time_limit_seconds)}) {
    if (!status) return status.error();
  }
  if (options.memory_bytes < kMinBatchBytes) {
    return at_option("--memory", fmt::format("{} is less than any job takes; give {}M or more", arguments.text("--memory"),
                                             kMinBatchBytes >> 20))
        .error();
  }
  if (options.jobs == 0) options.jobs = static_cast<std::uint32_t>(std::max(tbb::info::default_concurrency(), 1));
  options.fail_fast = arguments.has("--fail-fast");
  if (options.fail_fast && arguments.has("--keep-going")) return usage("--keep-going and --fail-fast exclude each other");
  std::array<std::uint32_t, 2> shard{};
  if (arguments.has("--shard") && arguments.has("--plan-shares"))
    return usage("--shard and --plan-shares exclude each other; plan first, then run each share");
  if (Status status = arguments.read("--plan-shares", {1, 1'000'000}, options.shares); !status) return status.error();
  if (arguments.has("--shard")) {
    if (Status status = arguments.read("--shard", read_shard, shard); !status) return status.error();
    options.share = shard[0] + 1;
    options.shares = shard[1];
  }
  options.resume = arguments.has("--resume");
  options.overwrite = arguments.has("--overwrite");
  if (options.resume && options.overwrite)
    return usage("--resume and --overwrite exclude each other; --resume keeps what --overwrite replaces");
  return options;
}

/// One line per job, with a status line below on a terminal.
class BatchConsole {
 public:
  BatchConsole(const Arguments& arguments, Context& context)
      : context_(context),
        quiet_(arguments.has("--quiet")),
        terminal_(is_terminal() && arguments.text("--progress") != "json") {}

  void ended(const BatchJob& job, const BatchResult& result, const BatchState& state) {
    if (quiet_) {
      if (result.failed()) context_.complain({static_cast<Fault>(result.code), failure_line(job, result)});
      return;
    }
    clear();
    context_.say(job_line(job, result, ++ended_, state.total));
  }

  void progress(const BatchState& state) {
    context_.progress({ProgressEvent::Stage::kJobs, state.ended, state.total});
    if (quiet_ || !terminal_) return;
    context_.say_text(line_.draw(progress_line(state), terminal_columns()));
  }

  void clear() {
    if (terminal_) context_.say_text(line_.clear());
  }

 private:
  Context& context_;
  bool quiet_, terminal_;
  StatusLine line_;
  std::uint32_t ended_ = 0;
};

/// Reads --sync. errors  kUsage
Result<Durable> read_sync(const Arguments& arguments) {
  Job job;
  const auto key = std::ranges::find(job_keys(), "--sync", &JobKey::flag);
  if (arguments.has(key->flag)) {
    if (Status status = at_option(key->flag, key->read(arguments.text(key->flag), job)); !status) return status.error();
  }
  return job.sync == Sync::kOff ? Durable::kNo : Durable::kAll;
}

/// The progress of a batch in its directory.
Outcome print_status(const Arguments& arguments, Context& context) {
  if (arguments.operands.size() != 1)
    return usage("--status: name the directory of one batch, as in lamina batch out --status");
  for (const char* option : {"-o,--output", "--shard", "--plan-shares", "--resume", "--overwrite"}) {
    if (arguments.has(option)) return at_option(option, "is of batches that run; remove --status");
  }
  const Result<BatchDirectory> batch = read_batch_directory(arguments.operands.front());
  if (!batch) return batch.error();
  const Status printed = arguments.has("--json") ? context.give(status_json(*batch)) : context.print(status_text(*batch));
  return printed ? Outcome(batch->code()) : Outcome(printed);
}

/// Plans the shares and reports their costs.
Outcome plan_only(std::vector<BatchEntry> entries, const BatchShare& share, const BatchOptions& options,
                  const std::vector<std::string>& with, const Arguments& arguments, Context& context) {
  BatchConsole console(arguments, context);
  keep_on_signals();
  BatchState state;
  state.total = static_cast<std::uint32_t>(entries.size());
  const auto progress = [&](std::size_t planned) {
    state.ended = static_cast<std::uint32_t>(planned);
    console.progress(state);
  };
  const Result<SharePlan> plan = plan_by_dry_runs(std::move(entries), share, options, with, progress, context.cancel());
  console.clear();
  if (!plan) return plan.error();
  const std::vector<std::uint64_t> costs = plan->costs();
  const double total = static_cast<double>(std::accumulate(costs.begin(), costs.end(), std::uint64_t{0}));
  const double largest = static_cast<double>(std::ranges::max(costs)), mean = total / plan->shares;
  const bool seconds = plan->unit == kPlannedUnit;
  if (!arguments.has("--quiet")) {
    std::string text = fmt::format("{}: {} jobs in {} shares", plan_path(options.directory), plan->jobs.size(), plan->shares);
    if (seconds) text += fmt::format(", estimated on one processor: {} at most", readable_seconds(largest / 1e6));
    context.say(text + fmt::format(", {:.3f} times the mean", largest / mean));
  }
  if (!arguments.has("--json")) return {};
  Json reported = {{"command", "batch"},
                   {"directory", options.directory},
                   {"jobs_total", plan->jobs.size()},
                   {"plan", {{"shares", plan->shares}, {"max_by_mean", largest / mean}}}};
  if (seconds) reported["plan"]["max_seconds"] = largest / 1e6;
  return context.give(reported);
}

Outcome run_batch_command(const Arguments& arguments, Context& context) {
  if (arguments.has("--status")) return print_status(arguments, context);
  const bool quiet = arguments.has("--quiet");
  std::vector<std::string> with;
  const Result<Durable> durable = read_sync(arguments);
  if (!durable) return durable.error();
  Result<BatchOptions> read = read_options(arguments, with);
  if (!read) return read.error();
  read->sync_in_groups = arguments.text("--sync").empty() || arguments.text("--sync") == "job";
  read->loaded = std::make_shared<load::PartStore>(loaded_share(read->memory_bytes, 0));
  const BatchOptions& options = *read;
  Result<std::vector<BatchEntry>> entries = read_batch(arguments.operands, with);
  if (!entries) return entries.error();
  add_container(*entries, arguments.text("--container"));
  const auto cache = open_cache(arguments, context);
  if (!cache) return cache.error();
  const BatchShare share{options.directory, layer_share(options.memory_bytes, options.jobs),
                         *cache ? &(*cache)->inputs() : nullptr};
  if (arguments.has("--plan-shares")) return plan_only(std::move(*entries), share, options, with, arguments, context);
  std::optional<BatchRecord> record;
  auto prepared = options.shares > 0 ? prepare_share(std::move(*entries), share, options, with, record)
                                     : prepare_undivided(std::move(*entries), share, options, record);
  if (!prepared) return prepared.error();
  const auto jobs = std::make_shared<const std::vector<BatchJob>>(std::move(*prepared));

  BatchConsole console(arguments, context);
  keep_on_signals();  // jobs that are done
  BatchWatcher watcher;
  watcher.progress = [&](const BatchState& state) { console.progress(state); };
  watcher.ended = [&](const BatchJob& job, const BatchResult& result, const BatchState& state) {
    console.ended(job, result, state);
  };
  const RunJob runner = job_runner(arguments.text("--sync"), options.loaded, *cache);
  const Result<BatchSummary> summary = run_batch(jobs, std::move(*record), options, runner, watcher, context.cancel());
  console.clear();
  if (!summary) return summary.error();
  const FileOptions how{.follow = false, .durable = *durable};
  const Status written = write_summaries(*jobs, *summary, options, kJsonSchema, how);
  int code = written ? batch_code(*summary) : context.complain(written.error());
  if (!quiet) context.say_text(batch_text(*jobs, *summary, options));
  if (*cache) {
    for (const std::string& note : (*cache)->take_notes()) context.say("note: " + note);
  }
  if (summary->interrupted) {
    context.complain({Fault::kInterrupted, "interrupted; finished jobs are kept; continue with the same command and --resume"});
  }
  if (arguments.has("--json")) {
    const auto print = [&](std::string_view piece) { return context.print(piece); };
    if (Status status = write_batch_json(*jobs, *summary, options, kJsonSchema, -1, print); !status)
      code = context.complain(status.error());
  }
  if (summary->abandoned) {  // a job that does not stop is still running
    remove_watched();
    std::_Exit(code);
  }
  return code;
}

}  // namespace

const Command batch_command = {"batch", "run many jobs with shared processors and memory", batch_spec, run_batch_command};

}  // namespace lamina::pipeline
