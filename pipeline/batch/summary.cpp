#include "pipeline/batch/summary.h"
#include "pipeline/flow/progress.h"
#include "pipeline/text/readable.h"
#include "pipeline/text/version.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/text/json_text.h"

namespace lamina::pipeline {
namespace {

std::string cell(std::string_view text) {
  std::string line = one_line(text);
  std::ranges::replace(line, '\t', ' ');
  return line;
}

}  // namespace

BatchTotals totals_of(const std::vector<BatchResult>& results) {
  BatchTotals totals;
  totals.jobs = static_cast<std::uint32_t>(results.size());
  for (const BatchResult& result : results) {
    switch (result.outcome) {
      case BatchOutcome::kDone: ++totals.done; break;
      case BatchOutcome::kKept: ++totals.kept; break;
      case BatchOutcome::kFailed:
      case BatchOutcome::kTimeLimit: ++totals.failed; break;
      case BatchOutcome::kStopped: ++totals.stopped; break;
      case BatchOutcome::kNotRun: ++totals.not_run; break;
    }
    totals.files += result.output.files;
    totals.bytes += result.output.bytes;
    if (result.outcome != BatchOutcome::kKept) totals.job_seconds += result.seconds;
  }
  return totals;
}

int batch_code(const BatchSummary& summary) {
  if (summary.interrupted) return static_cast<int>(Fault::kInterrupted);
  const auto failed = std::ranges::find_if(summary.results, has_failed);
  if (failed != summary.results.end()) return failed->code;
  const auto ended = [](const BatchResult& result) { return result.code == 0 && result.outcome != BatchOutcome::kNotRun; };
  return std::ranges::all_of(summary.results, ended) ? 0 : static_cast<int>(Fault::kInterrupted);
}

bool has_failed(const BatchResult& result) {
  return result.outcome == BatchOutcome::kFailed || result.outcome == BatchOutcome::kTimeLimit;
}

std::string failure_line(const BatchJob& job, const BatchResult& result) {
  const std::string& source = job.entry.source;
  return one_line(result.reason.starts_with(source) ? result.reason : fmt::format("{}: {}", source, result.reason));
}

std::string batch_json(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options) {
  const BatchTotals totals = totals_of(summary.results);
  std::string text = fmt::format(
      "{{\"command\":\"batch\",\"version\":\"{}\",\"directory\":{},\"code\":{},\"interrupted\":{},\"jobs_total\":{},"
      "\"done\":{},\"kept\":{},\"failed\":{},\"stopped\":{},\"not_run\":{},\"files\":{},\"bytes\":{},\"seconds\":{:.3f},"
      "\"job_seconds\":{:.3f},\"most_at_work\":{},\"memory_budget_bytes\":{},\"most_need_bytes\":{},"
      "\"peak_resident_bytes\":{},\"jobs\":[\n",
      version(), json_string(options.directory), batch_code(summary), summary.interrupted, totals.jobs, totals.done,
      totals.kept, totals.failed, totals.stopped, totals.not_run, totals.files, totals.bytes, summary.seconds,
      totals.job_seconds, summary.most_at_work, options.memory_bytes, summary.most_need_bytes, peak_resident_bytes());
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    text += result_json(jobs[i], static_cast<std::uint32_t>(i + 1), summary.results[i]);
    text += i + 1 < jobs.size() ? ",\n" : "\n";
  }
  return text + "]}\n";
}

std::string batch_table(const std::vector<BatchJob>& jobs, const BatchSummary& summary) {
  std::string text = "job\toutcome\tcode\tseconds\tfiles\tbytes\toutput\tsource\treason\n";
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const BatchResult& result = summary.results[i];
    text += fmt::format("{}\t{}\t{}\t{:.3f}\t{}\t{}\t{}\t{}\t{}\n", i + 1, outcome_name(result.outcome), result.code,
                        result.seconds, result.output.files, result.output.bytes, cell(jobs[i].place),
                        cell(jobs[i].entry.source), cell(result.reason));
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
  return line + readable_seconds(result.seconds);
}

std::string progress_line(const BatchState& state) {
  std::string line = fmt::format("{}/{} jobs", state.ended, state.total);
  if (state.failed > 0) line += fmt::format(", {} failed", state.failed);
  for (std::size_t i = 0; i < state.at_work.size(); ++i) {
    const BatchAtWork& job = state.at_work[i];
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
    if (has_failed(result)) line(outcome_name(result.outcome), failure_line(jobs[i], result));
  }
  line("files",
       fmt::format("{} of {} below {}", readable_count(totals.files), readable_bytes(totals.bytes), options.directory));
  line("time", fmt::format("{}; {:.1f} jobs/s, {} at once at most", readable_seconds(summary.seconds),
                           summary.seconds > 0 ? (totals.done + totals.failed) / summary.seconds : 0, summary.most_at_work));
  line("memory",
       fmt::format("{} at most, budget {}", readable_bytes(peak_resident_bytes()), readable_bytes(options.memory_bytes)));
  return text;
}

}  // namespace lamina::pipeline
