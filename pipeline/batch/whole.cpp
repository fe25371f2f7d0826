#include "pipeline/batch/whole.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "pipeline/batch/shares.h"
#include "pipeline/batch/summary.h"
#include "pipeline/job/errors.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/journal.h"
#include "stages/support/text/json_text.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kOpenRecords = 128;  // a process may have 1,024 open files

/// Counts a job that ended and adds it.
void add_ended(RecordedJob job, ShareState& state, BatchDirectory& batch) {
  ++(job.result.failed() ? state.failed : state.done);
  const std::string position = job.job.output;
  if (!position.empty() && !job.elsewhere) job.job.output = (fs::path(batch.directory) / position).string();
  job.job.below = static_cast<std::uint32_t>(job.job.output.size() - position.size());
  batch.jobs.push_back(std::move(job));
  batch.from.push_back(state.number);
}

Status read_undivided(BatchDirectory& batch) {
  const BatchFiles files(batch.directory);
  Result<RecordedBatch> record = read_record(files);
  if (!record) return record.error();
  ShareState state{.started = record->planned > 0 || !record->jobs.empty(), .running = is_journal_held(files.record())};
  std::size_t last = 0;
  for (auto& [key, job] : record->jobs) {
    last = std::max<std::size_t>(last, job.job.number);
    if (job.ended) add_ended(std::move(job), state, batch);
  }
  // A record whose first line was lost or is of an earlier version may have more jobs.
  state.jobs = std::max(record->planned > 0 ? record->planned : last, state.done + state.failed);
  batch.states.push_back(state);
  return {};
}

Status read_share(const SharePlan& plan, ShareState& state, BatchDirectory& batch) {
  const BatchFiles files(batch.directory, state.number, plan.shares);
  if (!is_file(files.record())) return {};
  state.running = is_journal_held(files.record());
  Result<RecordedBatch> record = read_record(files);
  if (!record) return record.error();
  const bool current = record->plan == plan.generation;
  state.started = current || state.running;
  if (!current) return {};  // of a plan that was replaced
  for (auto& [key, job] : record->jobs) {
    const std::uint32_t number = job.job.number;
    if (!job.ended || number == 0 || number > plan.jobs.size()) continue;
    if (plan.jobs[number - 1].share == state.number) add_ended(std::move(job), state, batch);
  }
  return {};
}

/// Adds time and memory of a share, from the members in front of the jobs in its summary: the longest, the largest.
void add_usage(const std::string& path, BatchSummary& summary, BatchOptions& options) try {
  auto file = FileReader::open(path, {.fault = Fault::kOutput, .longest_line = 1 << 20});
  if (!file) return;
  std::string text;
  for (std::string_view line; file->next(line) && !line.starts_with("  \"jobs\"");) text += line;
  const Json head = parse_json(text + "\"jobs\": []}");
  const auto raise = [&](std::string_view name, auto& value) {
    const Json* member = head.find(name);
    if (member != nullptr) value = std::max(value, member->get<std::remove_reference_t<decltype(value)>>());
  };
  raise("seconds", summary.seconds);
  raise("max_running", summary.max_running);
  raise("max_need_bytes", summary.max_need_bytes);
  raise("peak_resident_bytes", summary.peak_resident_bytes);
  raise("memory_budget_bytes", options.memory_bytes);
} catch (const JsonError&) {
  return;  // damaged; the records have the results
}

/// Writes batch.jsonl with the last lines of every job. Sets the lines of the results to those in it.
Status write_record(const BatchDirectory& batch, const FileOptions& how, const std::atomic<bool>& cancel,
                    std::vector<BatchResult>& results) {
  Result<File> file = File::open(BatchFiles(batch.directory).record(), how);
  if (!file) return file.error();
  Status status = file->append(json_line({{"jobs", batch.jobs.size()}}));
  std::map<std::uint32_t, RecordedValues> records;
  for (std::size_t i = 0; i < batch.jobs.size() && status; ++i) {
    if (cancel) return failure(Fault::kInterrupted, "{}: interrupted; nothing is merged", batch.directory);
    const BatchFiles files(batch.directory, batch.from[i], batch.shares);
    if (records.size() == kOpenRecords && !records.contains(files.share)) records.clear();
    RecordedValues& record = records.try_emplace(files.share, files).first->second;
    for (const RecordedLine& line : {batch.jobs[i].begun, batch.jobs[i].result.line}) {
      if (line.bytes == 0) continue;
      const Result<std::string> text = record.line_at(line);
      if (!text) return text.error();
      results[i].line = {file->size(), line.bytes};
      status = file->append(*text + "\n");
    }
  }
  if (!status) return status;
  const auto done = file->finish();
  return done ? Status() : Status(done.error());
}

}  // namespace

int BatchDirectory::code() const {
  if (std::ranges::any_of(states, &ShareState::is_open)) return static_cast<int>(Fault::kVerification);
  BatchSummary summary;
  for (const RecordedJob& job : jobs) summary.results.push_back(job.result);
  return batch_code(summary);
}

bool is_batch_directory(const std::string& directory) {
  return has_shares(directory) || is_file(BatchFiles(directory).record());
}

Result<BatchDirectory> read_batch_directory(const std::string& directory) {
  if (!is_batch_directory(directory))
    return usage("{}: no directory of a batch; name the one after -o of lamina batch", directory);
  BatchDirectory batch;
  batch.directory = directory;
  if (!has_shares(directory)) {
    if (Status status = read_undivided(batch); !status) return status.error();
  } else {
    const Result<SharePlan> plan = read_plan(directory);
    if (!plan) return plan.error();
    batch.shares = plan->shares;
    batch.states.resize(plan->shares);
    for (const PlannedJob& job : plan->jobs) ++batch.states[job.share - 1].jobs;
    for (std::uint32_t share = 1; share <= plan->shares; ++share) {
      batch.states[share - 1].number = share;
      if (Status status = read_share(*plan, batch.states[share - 1], batch); !status) return status.error();
    }
  }
  std::vector<std::size_t> order(batch.jobs.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::sort(order, {}, [&](std::size_t i) { return batch.jobs[i].job.number; });
  BatchDirectory sorted = batch;
  for (std::size_t i = 0; i < order.size(); ++i) {
    sorted.jobs[i] = std::move(batch.jobs[order[i]]);
    sorted.from[i] = batch.from[order[i]];
  }
  return sorted;
}

std::string status_text(const BatchDirectory& batch) {
  std::string text;
  for (const ShareState& state : batch.states) {
    if (batch.shares > 0) text += fmt::format("share {} of {}: ", state.number, batch.shares);
    text += fmt::format("{} of {} jobs done", state.done, state.jobs);
    if (state.failed > 0) text += fmt::format(", {} failed", state.failed);
    if (state.missing() > 0) text += fmt::format(", {} missing", state.missing());
    text += state.running ? ", running\n" : state.started || (batch.shares > 0 && state.jobs == 0) ? "\n" : ", never started\n";
  }
  return text;
}

Json status_json(const BatchDirectory& batch) {
  ShareState total;
  Json shares = Json::array();
  for (const ShareState& state : batch.states) {
    total.jobs += state.jobs;
    total.done += state.done;
    total.failed += state.failed;
    if (batch.shares == 0) continue;
    shares.push_back({{"share", state.number},
                      {"jobs", state.jobs},
                      {"done", state.done},
                      {"failed", state.failed},
                      {"missing", state.missing()},
                      {"started", state.started},
                      {"running", state.running}});
  }
  const bool running = std::ranges::any_of(batch.states, &ShareState::running);
  return {{"command", "batch"},         {"directory", batch.directory}, {"code", batch.code()},
          {"jobs_total", total.jobs},   {"done", total.done},           {"failed", total.failed},
          {"missing", total.missing()}, {"running", running},           {"shares", shares}};
}

std::vector<std::string> missing_lines(const BatchDirectory& batch) {
  std::vector<std::string> lines;
  for (const ShareState& state : batch.states) {
    if (!state.is_open()) continue;
    const std::string share = batch.shares == 0 ? "" : fmt::format("share {} of {}: ", state.number, batch.shares);
    if (!state.started && batch.shares == 0) {
      lines.push_back(state.running ? "has just started; wait for it" : "no job was started; run the batch again");
    } else if (!state.started) {
      lines.push_back(fmt::format("{}never started; run it with --shard {}/{}", share, state.number, batch.shares));
    } else if (state.running) {
      lines.push_back(fmt::format("{}running, {} jobs missing; wait for it", share, state.missing()));
    } else {
      lines.push_back(fmt::format("{}not finished: {} jobs missing; run it again with --resume", share, state.missing()));
    }
  }
  return lines;
}

Status merge_shares(const BatchDirectory& batch, std::int64_t schema, const FileOptions& how, const std::atomic<bool>& cancel) {
  BatchOptions options;
  options.directory = batch.directory;
  options.memory_bytes = 0;
  BatchSummary summary;
  std::vector<BatchJob> jobs;
  for (const RecordedJob& job : batch.jobs) {
    jobs.push_back(job.job);
    summary.results.push_back(job.result);
  }
  for (std::uint32_t share = 1; share <= batch.shares; ++share)
    add_usage(BatchFiles(batch.directory, share, batch.shares).summary(), summary, options);
  if (Status status = write_record(batch, how, cancel, summary.results); !status) return status;
  if (Status status = write_summaries(jobs, summary, options, schema, how); !status) return status;
  // First the plan: without it the directory is that of an undivided batch.
  std::error_code error;
  fs::remove(plan_path(batch.directory), error);
  return error ? Status(failure(Fault::kOutput, "{}: {}", plan_path(batch.directory), error.message())) : Status();
}

}  // namespace lamina::pipeline
