#include <fmt/format.h>
#include <tbb/info.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/job_call.h"
#include "pipeline/job/errors.h"
#include "pipeline/job/keys.h"
#include "pipeline/watch/after_job.h"
#include "pipeline/watch/moves.h"
#include "pipeline/watch/watcher.h"
#include "stages/load/part_store.h"
#include "stages/support/io/temporary.h"
#include "stages/support/text/escape.h"
#include "stages/support/text/number_text.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

CommandSpec watch_spec() {
  CommandSpec spec;
  const auto sync = std::ranges::find(job_keys(), "--sync", &JobKey::flag);
  spec.summary =
      "Plans each part and each job file that is put into a folder or below it, as soon as it is complete, and moves it to\n"
      "FOLDER/done or FOLDER/failed. Runs until it is stopped; a killed watcher continues where it was.";
  spec.operand = "FOLDER";
  spec.operand_meaning = "folder that is watched, with all folders below it";
  spec.options = {
      {"-o,--output", "DIR", "directory of results, errors and the record watch.jsonl", "", ""},
      {"--with", "WORDS", "command and options for parts, as in --with 'jet --dpi 600'", "jet", ""},
      {"--then", "WORDS", "shell command after each job, with LAMINA_OUTPUT set", "", ""},
      {"--then-limit", "SECONDS", "time limit of the --then command in seconds; 0: none", "600", ""},
      {"--once", "", "end when nothing is left to do", "", ""},
      {"--settle", "SECONDS", "time without a change until a file is complete, in seconds", "2", "Files"},
      {"--poll", "SECONDS", "interval in which the folder is read, in seconds", "1", "Files"},
      {"--done", "FOLDER", "folder for planned parts; default: FOLDER/done", "", "Files"},
      {"--failed", "FOLDER", "folder for parts that failed; default: FOLDER/failed", "", "Files"},
      {"--jobs", "N", "max number of concurrent jobs; 0: one per processor", "0", "Run"},
      {"--memory", "SIZE", "memory limit of all running jobs: 512M, 4G", "1G", "Run"},
      {"--time-limit", "SECONDS", "time limit per job in seconds; slower jobs fail with exit code 3", "", "Run"},
      {"--sync", "WHEN", "when files are flushed to disk: job (at its end), layer or off", "job", "Run", sync->words()},
      {"--json", "", "print one JSON object on stdout for each ended job", "", "Run"},
      {"--quiet", "", "print errors only", "", "Run"}};
  spec.closing =
      "A part is complete when it is renamed into the folder, when a writer closes it and it has the length that its format\n"
      "states (binary STL, 3MF, gzip), or when it stays unchanged for --settle. bracket.toml next to bracket.stl is its job\n"
      "file. A watch.toml in a folder sets with, then, settle_s and output for it. SIGTERM and SIGINT end the watcher with\n"
      "exit code 0, with --once 130.\n\n"
      "Examples:\n"
      "  lamina watch parts/ --with 'jet --dpi 600' -o out --once\n"
      "  lamina watch parts/ --with 'extrude --machine marlin' -o out --once --then 'echo \"$LAMINA_OUTPUT\" >> queue.txt'";
  return spec;
}

/// errors  kUsage
Result<WatchOptions> read_watch_options(const Arguments& arguments) {
  WatchOptions options;
  if (arguments.operands.size() != 1) return usage("name one folder to watch, as in: lamina watch in/ -o out");
  options.folder = arguments.operands.front();
  options.output = options.settings.output = arguments.text("-o,--output");
  if (options.output.empty()) return usage("-o DIR is missing; name the directory of results");
  const auto with = split_words(arguments.has("--with") ? arguments.text("--with") : "jet");
  if (!with) return at_option("--with", with.error().message).error();
  options.settings.with = *with;
  options.settings.then = arguments.text("--then");
  options.done = arguments.text("--done");
  options.failed = arguments.text("--failed");
  options.once = arguments.has("--once");
  options.jobs = 0;
  for (const Status& status :
       {arguments.read("--jobs", {0, 1024}, options.jobs), arguments.read("--memory", read_bytes, options.memory_bytes),
        arguments.read("--settle", {0, 1e6, " s"}, options.settings.settle_seconds),
        arguments.read("--time-limit", {0.001, 1e9, " s"}, options.time_limit_seconds),
        arguments.read("--then-limit", {0, 1e6, " s"}, options.then_limit_seconds),
        arguments.read("--poll", {0.01, 3600, " s"}, options.poll_seconds)}) {
    if (!status) return status.error();
  }
  if (options.jobs == 0) options.jobs = static_cast<std::uint32_t>(std::max(tbb::info::default_concurrency(), 1));
  return options;
}

std::string planned_line(const WatchedJob& job) {
  const BatchResult& result = job.result;
  if (result.code != 0) return fmt::format("failed   {}: {}", job.part, result.reason);
  std::string line = fmt::format("planned  {}: ", job.part);
  if (job.has_output) {
    line += fmt::format("{}, {} {}, {}, ", result_path(job), result.output.files, result.output.files == 1 ? "file" : "files",
                        readable_bytes(result.output.bytes));
  }
  return line + readable_seconds(result.seconds);
}

Json ended_json(const WatchedJob& job, std::optional<int> then_code) {
  const BatchResult& result = job.result;
  return {{"command", "watch"},
          {"part", job.part},
          {"words", job.words},
          {"outcome", result.code == 0 ? "done" : "failed"},
          {"code", result.code},
          {"reason", result.reason},
          {"output", result_path(job)},
          {"moved", job.now},
          {"seconds", std::round(result.seconds * 1000) / 1000},
          {"files", result.output.files},
          {"bytes", result.output.bytes},
          {"hash", hex(result.output.hash)},
          {"then_code", then_code ? Json(*then_code) : Json()},
          {"result", result.value}};
}

/// As a batch: that of the first failed job; else of a file that is left, which matters for a watcher that ends by itself.
int watch_code(const WatchSummary& summary, bool once) {
  if (!once) return 0;
  if (summary.interrupted) return static_cast<int>(Fault::kInterrupted);
  if (summary.code != 0) return summary.code;
  return summary.left == Fault::kInterrupted ? 0 : static_cast<int>(summary.left);
}

Outcome run_watch_command(const Arguments& arguments, Context& context) {
  Result<WatchOptions> options = read_watch_options(arguments);
  if (!options) return options.error();
  options->loaded = std::make_shared<load::PartStore>(loaded_share(options->memory_bytes, 0));
  const bool quiet = arguments.has("--quiet"), json = arguments.has("--json");
  keep_on_signals();  // jobs that are done
  const std::atomic<bool>& interrupt = context.cancel();
  Status printed;
  const WatchObserver observer{
      [&](const std::string& line) {
        context.complain({Fault::kInput, line});
      },
      [&](const WatchedJob& job) {
        if (job.result.code != 0) {
          context.complain({static_cast<Fault>(job.result.code), one_line(planned_line(job))});
        } else if (!quiet) {
          context.say(planned_line(job));
        }
      },
      [&](const WatchedJob& job, std::optional<int> then_code) {
        if (!quiet) context.say(fmt::format("moved    {} to {}", job.part, job.now));
        if (then_code.value_or(0) != 0)
          context.complain({Fault::kInternal, fmt::format("{}: --then ended with exit code {}{}", job.part, *then_code,
                                                          *then_code == kThenOverdue ? " (time limit)" : "")});
        if (json && printed) printed = context.give(ended_json(job, then_code));
      },
      [&](const Error& error) { context.complain(error); }};
  const Result<WatchSummary> summary =
      watch_folder(*options, read_call, job_runner(arguments.text("--sync"), options->loaded), observer, interrupt);
  if (!summary) return summary.error();
  if (!quiet) context.say(fmt::format("{} done, {} failed", summary->done, summary->failed));
  int code = printed ? watch_code(*summary, options->once) : context.complain(printed.error());
  if (summary->problem) code = context.complain(*summary->problem);
  if (summary->abandoned) {  // a job that does not stop is still running
    remove_watched();
    std::_Exit(code);
  }
  return code;
}

}  // namespace

const Command watch_command = {"watch", "plan parts as they are put into a folder", watch_spec, run_watch_command};

}  // namespace lamina::pipeline
