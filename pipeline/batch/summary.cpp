#include "pipeline/batch/summary.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "stages/support/text/json_text.h"
#include "stages/support/text/readable.h"
#include "stages/support/text/version.h"

namespace lamina::pipeline {
namespace {

std::string warnings_text(std::size_t count) { return fmt::format("{} warning{}", count, count == 1 ? "" : "s"); }

/// Totals of the batch.
struct BatchTotals {
  std::uint32_t jobs = 0, done = 0, kept = 0, failed = 0, stopped = 0, not_run = 0;  // failed: time limit too
  std::uint64_t files = 0, bytes = 0, warnings = 0;
  double job_seconds = 0;  // of all jobs that ran
};

BatchTotals totals_of(const std::vector<BatchResult>& results) {
  using Totals = BatchTotals;
  constexpr std::uint32_t Totals::*kCounts[] = {&Totals::done,   &Totals::kept,    &Totals::failed,
                                                &Totals::failed, &Totals::stopped, &Totals::not_run};
  Totals totals;
  totals.jobs = static_cast<std::uint32_t>(results.size());
  for (const BatchResult& result : results) {
    ++(totals.*kCounts[static_cast<std::size_t>(result.outcome)]);
    totals.files += result.output.files;
    totals.bytes += result.output.bytes;
    totals.warnings += result.warnings;
    if (result.outcome != BatchOutcome::kKept) totals.job_seconds += result.seconds;
  }
  return totals;
}

}  // namespace

std::string table_cell(std::string_view text) {
  std::string line = one_line(text);
  std::ranges::replace(line, '\t', ' ');
  return line;
}

int batch_code(const BatchSummary& summary) {
  if (summary.interrupted) return static_cast<int>(Fault::kInterrupted);
  const auto failed = std::ranges::find_if(summary.results, &BatchResult::failed);
  if (failed != summary.results.end()) return failed->code;
  const auto ended = [](const BatchResult& result) { return result.code == 0 && result.outcome != BatchOutcome::kNotRun; };
  return std::ranges::all_of(summary.results, ended) ? 0 : static_cast<int>(Fault::kInterrupted);
}

std::string failure_line(const BatchJob& job, const BatchResult& result) {
  const std::string& source = job.entry.source;
  return one_line(result.reason.starts_with(source) ? result.reason : fmt::format("{}: {}", source, result.reason));
}

Status write_batch_json(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options,
                        std::int64_t schema, int indent, const std::function<Status(std::string_view)>& append) {
  const BatchTotals totals = totals_of(summary.results);
  const auto rounded = [](double seconds) { return std::round(seconds * 1000) / 1000; };
  Json json = {{"schema", schema},
               {"command", "batch"},
               {"version", version()},
               {"directory", options.directory},
               {"code", batch_code(summary)},
               {"interrupted", summary.interrupted},
               {"jobs_total", totals.jobs},
               {"done", totals.done},
               {"kept", totals.kept},
               {"failed", totals.failed},
               {"stopped", totals.stopped},
               {"not_run", totals.not_run},
               {"warnings", totals.warnings},
               {"files", totals.files},
               {"bytes", totals.bytes},
               {"seconds", rounded(summary.seconds)},
               {"job_seconds", rounded(totals.job_seconds)},
               {"max_running", summary.max_running},
               {"memory_budget_bytes", options.memory_bytes},
               {"max_need_bytes", summary.max_need_bytes},
               {"peak_resident_bytes", summary.peak_resident_bytes}};
  if (options.shares > 0) json["shard"] = fmt::format("{}/{}", options.share, options.shares);
  json["jobs"] = Json::array();
  const std::string head = json_text(json, indent), line = indent < 0 ? "" : "\n" + std::string(indent, ' '),
                    own_line = indent < 0 ? "" : "\n" + std::string(2 * indent, ' ');
  const std::size_t end = head.rfind(']');  // of the jobs
  Status status = append(std::string_view(head).substr(0, end));
  RecordedValues values(options.files());
  for (std::size_t i = 0; i < jobs.size() && status; ++i) {
    const Result<Json> value = values.of(summary.results[i]);
    if (!value) return value.error();
    std::string text = (i == 0 ? "" : ",") + own_line;
    for (const char c : json_text(result_json(jobs[i], summary.results[i], *value), indent)) {
      c == '\n' ? text += own_line : text += c;
    }
    status = append(text);
  }
  if (!status) return status;
  return append((jobs.empty() ? "" : line) + head.substr(end) + "\n");
}

Status write_summaries(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options,
                       std::int64_t schema, const FileOptions& how) {
  Result<File> file = File::open(options.files().summary(), how);
  if (!file) return file.error();
  const auto append = [&](std::string_view piece) { return file->append(piece); };
  if (Status status = write_batch_json(jobs, summary, options, schema, 2, append); !status) return status;
  if (const auto done = file->finish(); !done) return done.error();
  return write_file(options.files().table(), batch_table(jobs, summary), how);
}

std::string batch_table(const std::vector<BatchJob>& jobs, const BatchSummary& summary) {
  std::string text = "job\toutcome\tcode\tseconds\tfiles\tbytes\toutput\tsource\treason\n";
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const BatchResult& result = summary.results[i];
    text += fmt::format("{}\t{}\t{}\t{:.3f}\t{}\t{}\t{}\t{}\t{}\n", jobs[i].number, outcome_name(result.outcome), result.code,
                        result.seconds, result.output.files, result.output.bytes, table_cell(jobs[i].position()),
                        table_cell(jobs[i].entry.source), table_cell(result.reason));
  }
  return text;
}

std::string job_line(const BatchJob& job, const BatchResult& result, std::uint32_t ended, std::uint32_t total) {
  std::string line = fmt::format("[{}/{}] {:<10} {}: ", ended, total, outcome_name(result.outcome), job.entry.name);
  if (!result.reason.empty()) return line + result.reason;
  if (result.output.files > 0) {
    line += fmt::format("{} {}, {}, ", result.output.files, result.output.files == 1 ? "file" : "files",
                        readable_bytes(result.output.bytes));
  }
  line += readable_seconds(result.seconds);
  return result.warnings > 0 ? line + ", " + warnings_text(result.warnings) : line;
}

std::string progress_line(const BatchState& state) {
  std::string line = fmt::format("{}/{} jobs", state.ended, state.total);
  if (state.failed > 0) line += fmt::format(", {} failed", state.failed);
  for (std::size_t i = 0; i < state.running.size(); ++i) {
    const RunningJob& job = state.running[i];
    line += fmt::format("{} {}", i == 0 ? ";" : ",", job.name);
    if (job.layers > 0) line += fmt::format(" {}/{} layers", job.layers_done, job.layers);
  }
  return line;
}

std::string batch_text(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options) {
  const BatchTotals totals = totals_of(summary.results);
  std::string text;
  const auto line = [&](std::string_view name, const std::string& value) { text += fmt::format("{:<11}{}\n", name, value); };
  std::string counts = fmt::format("{}: {} done", totals.jobs, totals.done);
  for (const auto& [count, what] :
       {std::pair{totals.kept, "kept"}, {totals.failed, "failed"}, {totals.stopped, "stopped"}, {totals.not_run, "not run"}}) {
    if (count > 0) counts += fmt::format(", {} {}", count, what);
  }
  line("jobs", counts);
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const BatchResult& result = summary.results[i];
    if (result.failed()) line(outcome_name(result.outcome), failure_line(jobs[i], result));
    if (result.warnings > 0) {
      line("warning",
           one_line(fmt::format("{}: {}; {}", jobs[i].entry.source, warnings_text(result.warnings), result.first_warning)));
    }
  }
  line("files",
       fmt::format("{} of {} below {}", readable_count(totals.files), readable_bytes(totals.bytes), options.directory));
  line("time", fmt::format("{}; {:.1f} jobs/s, {} at once at most", readable_seconds(summary.seconds),
                           summary.seconds > 0 ? (totals.done + totals.failed) / summary.seconds : 0, summary.max_running));
  line("memory",
       fmt::format("{} at most, budget {}", readable_bytes(summary.peak_resident_bytes), readable_bytes(options.memory_bytes)));
  return text;
}

}  // namespace lamina::pipeline
