#include <fmt/format.h>
#include <tbb/info.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <span>

#include "pipeline/batch/queue.h"
#include "pipeline/batch/summary.h"
#include "pipeline/cli/batch_call.h"
#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/cli/signals.h"
#include "pipeline/text/json.h"
#include "pipeline/text/json_text.h"
#include "pipeline/text/number_text.h"
#include "stages/write/file.h"

namespace lamina::pipeline {
namespace {

CommandSpec batch_spec() {
  CommandSpec spec;
  spec.summary =
      "Runs many jobs in one queue that shares the processors and a memory budget. A job that fails does so alone; each\n"
      "result and reason is in OUT/summary.json and OUT/summary.tsv. A batch that was killed goes on with --resume.";
  spec.operand = "LIST";
  spec.operand_meaning =
      "lists with one command line a line (jet part.stl --dpi 600 -o part), directories of parts and job files, parts, "
      "TOML job files";
  spec.options = {
      {"-o,--output", "DIR", "directory of the batch; jobs write below it", "", ""},
      {"--with", "WORDS", "command and options for parts that come without any, as in --with 'jet --dpi 600'", "jet", ""},
      {"--jobs", "N", "jobs running at a time; 0 for as many as there are processors", "0", "Run"},
      {"--memory", "SIZE", "what all running jobs may hold together: 512M, 4G", "1G", "Run"},
      {"--time-limit", "SECONDS", "stop a job that takes longer: it fails, with exit code 3", "", "Run"},
      {"--keep-going", "", "a job that fails does not stop the others; this is what happens anyway", "", "Run"},
      {"--fail-fast", "", "the first job that fails stops the batch", "", "Run"},
      {"--resume", "", "go on with an earlier batch in DIR: jobs that are done, and whose files hold, are kept", "", "Run"},
      {"--overwrite", "", "replace an earlier batch in DIR", "", "Run"},
      {"--json", "", "print the summary as one JSON object on stdout", "", "Run"},
      {"--quiet", "", "say nothing but errors: a line for each job that fails", "", "Run"}};
  spec.closing =
      "A job is any command but batch and preview. -o of a job is below the batch's DIR; without one a job is called as its\n"
      "first file. Other paths are as on the command line. Jobs begin in order and must not need each other's results.\n\n"
      "Examples:\n"
      "  lamina batch parts/ -o out                                  lamina jet of every part\n"
      "  lamina batch parts/ --with 'jet --dpi 600 --format png' --jobs 4 --memory 8G -o out\n"
      "  lamina batch jobs.txt night/*.toml -o out --time-limit 3600\n"
      "  lamina batch jobs.txt -o out --resume\n"
      "  lamina batch parts/ --with info -o look && jq -r '.jobs[] | [.source, .result.closed] | @tsv' look/summary.json";
  return spec;
}

struct Request {
  std::vector<std::string> lists, with;
  BatchOptions options;
  bool json = false, quiet = false;
};

Result<Request> resolve(const Arguments& arguments) {
  Request request;
  BatchOptions& options = request.options;
  const auto wrong = [](std::string_view flag, const std::string& what) {
    return Error{Fault::kUsage, fmt::format("{}: {}", flag, what)};
  };
  request.lists = arguments.operands;
  if (request.lists.empty()) {
    return Error{Fault::kUsage, "no jobs; name a list, a directory of parts, or TOML job files"};
  }
  options.directory = arguments.text("-o,--output");
  if (options.directory.empty()) return Error{Fault::kUsage, "-o DIR is missing; name the directory of the batch"};
  const auto with = split_words(arguments.has("--with") ? arguments.text("--with") : "jet");
  if (!with) return wrong("--with", with.error().message);
  if (with->empty()) return wrong("--with", "no command; as in --with 'jet --dpi 600'");
  request.with = *with;
  std::int64_t jobs = 0;
  if (arguments.has("--jobs")) {
    if (const auto what = read_whole(arguments.text("--jobs"), 0, 1024, jobs); !what.empty()) return wrong("--jobs", what);
  }
  options.jobs =
      jobs > 0 ? static_cast<std::uint32_t>(jobs) : static_cast<std::uint32_t>(std::max(tbb::info::default_concurrency(), 1));
  if (arguments.has("--memory")) {
    if (const auto what = read_bytes(arguments.text("--memory"), options.memory_bytes); !what.empty())
      return wrong("--memory", what);
  }
  if (arguments.has("--time-limit")) {
    const auto what = read_number(arguments.text("--time-limit"), 0.001, 1e9, " s", options.time_limit_seconds);
    if (!what.empty()) return wrong("--time-limit", what);
  }
  options.fail_fast = arguments.has("--fail-fast");
  if (options.fail_fast && arguments.has("--keep-going")) {
    return Error{Fault::kUsage, "--keep-going and --fail-fast exclude each other"};
  }
  options.resume = arguments.has("--resume");
  options.overwrite = arguments.has("--overwrite");
  if (options.resume && options.overwrite) {
    return Error{Fault::kUsage, "--resume and --overwrite exclude each other; --resume keeps what --overwrite replaces"};
  }
  request.json = arguments.has("--json");
  request.quiet = arguments.has("--quiet");
  return request;
}

/// A line a job; on a terminal a line that is drawn again and again below them.
class BatchConsole {
 public:
  BatchConsole(bool quiet, Context& context) : context_(context), quiet_(quiet), terminal_(is_terminal()) {}

  void ended(const BatchJob& job, const BatchResult& result, const BatchState& state) {
    if (quiet_) {
      if (has_failed(result)) context_.complain({static_cast<Fault>(result.code), failure_line(job, result)});
      return;
    }
    clear();
    context_.say(job_line(job, result, ++ended_, state.total));
  }

  void progress(const BatchState& state) {
    if (quiet_ || !terminal_) return;
    context_.say_text("\r\x1b[K" +
                      progress_line(state).substr(0, static_cast<std::size_t>(std::max(terminal_columns() - 1, 1))));
    drawn_ = true;
  }

  void clear() {
    if (drawn_) context_.say_text("\r\x1b[K");
    drawn_ = false;
  }

 private:
  Context& context_;
  bool quiet_, terminal_, drawn_ = false;
  std::uint32_t ended_ = 0;
};

Status write_text_file(const std::string& directory, const char* name, const std::string& text) {
  return write::write_file((std::filesystem::path(directory) / name).string(), std::as_bytes(std::span(text)));
}

Outcome run_request(const Request& request, Context& context) {
  const BatchOptions& options = request.options;
  Result<std::vector<BatchEntry>> entries = read_batch(request.lists, request.with);
  if (!entries) return entries.error();
  const auto jobs =
      prepare_batch(std::move(*entries), {options.directory, layer_share(options.memory_bytes, options.jobs)}, read_call);
  if (!jobs) return jobs.error();
  Result<BatchRecord> record = BatchRecord::open(options.directory, options.resume, options.overwrite);
  if (!record) return record.error();

  BatchConsole console(request.quiet, context);
  keep_on_signals();  // jobs that are done
  BatchWatcher watcher;
  watcher.progress = [&](const BatchState& state) { console.progress(state); };
  watcher.ended = [&](const BatchJob& job, std::uint32_t, const BatchResult& result, const BatchState& state) {
    console.ended(job, result, state);
  };
  const Result<BatchSummary> summary = run_batch(*jobs, std::move(*record), options, watcher, context.cancel());
  console.clear();
  if (!summary) return summary.error();
  const Json json = batch_json(*jobs, *summary, options);
  Status written = write_text_file(options.directory, "summary.json", json_line(json, 2));
  if (written) written = write_text_file(options.directory, "summary.tsv", batch_table(*jobs, *summary));
  int code = written ? batch_code(*summary) : context.complain(written.error());
  if (!request.quiet) context.say_text(batch_text(*jobs, *summary, options));
  if (summary->interrupted) {
    context.complain({Fault::kInterrupted, "interrupted; what is done is kept, go on with the same command and --resume"});
  }
  if (request.json) {
    if (Status status = context.give(json); !status) code = context.complain(status.error());
  }
  if (summary->abandoned) std::_Exit(code);  // a job that does not stop is still running
  return code;
}

Outcome run_command(const Arguments& arguments, Context& context) {
  const Result<Request> request = resolve(arguments);
  if (!request) return request.error();
  return run_request(*request, context);
}

}  // namespace

const Command batch_command = {"batch", "many jobs in one queue, sharing processors and memory, with one summary", batch_spec,
                               run_command};

}  // namespace lamina::pipeline
