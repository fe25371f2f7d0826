#include "pipeline/cli/batch_shares.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "pipeline/batch/record.h"
#include "pipeline/batch/shares.h"
#include "pipeline/cli/job_call.h"
#include "pipeline/job/errors.h"
#include "stages/load/part_store.h"
#include "stages/support/clocks.h"

namespace lamina::pipeline {
namespace {

/// errors  kUsage: the directory belongs to a batch that is not divided, and is not overwritten
Status check_divided(const BatchOptions& options) {
  return options.overwrite || has_shares(options.directory) ? Status() : check_not_undivided(options.directory);
}

/// errors  kUsage: the directory belongs to a batch in shares, and is not overwritten
Status check_undivided(const BatchOptions& options) {
  if (options.overwrite || !has_shares(options.directory)) return {};
  return usage(
      "{}: belongs to a batch in shares; continue it with --shard, join it with lamina merge, or replace it with --overwrite",
      plan_path(options.directory));
}

/// The words without the output, which changes nothing in a dry run.
std::vector<std::string> without_output(const std::vector<std::string>& words) {
  std::vector<std::string> kept;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (words[i] == "-o" || words[i] == "--output") {
      ++i;
    } else if (!words[i].starts_with("--output=")) {
      kept.push_back(words[i]);
    }
  }
  return kept;
}

/// Processor seconds of the layers that a dry run has not made, from its summary. 0: it made them, or is of a job without
/// parts. What it takes to open and close the file of a layer is included as measured on Linux.
double estimate_seconds(const Json& summary) try {
  constexpr double kSecondsPerFile = 4e-5;
  const double files = summary.at("command").text() == "jet" ? summary.at("layers_total").get<double>() : 0;
  const Json* layers = summary.at("seconds").find("layers_estimate");
  return layers == nullptr ? 0 : layers->get<double>() + kSecondsPerFile * files;
} catch (const JsonError&) {
  return 0;
}

/// Processor seconds of loading, by the progress of a job.
class LoadClock {
 public:
  void see(const ProgressEvent& event) {
    const double now = process_seconds();
    if (began_) seconds_ += now - *began_;
    began_.reset();
    if (event.stage == ProgressEvent::Stage::kLoading) began_ = now;
  }
  double seconds() const { return seconds_; }

 private:
  std::optional<double> began_;
  double seconds_ = 0;
};

/// Costs in microseconds by dry runs.
class DryRuns {
 public:
  DryRuns(std::uint64_t memory_bytes, const std::atomic<bool>& cancel)
      : loaded_(std::make_shared<load::PartStore>(loaded_share(memory_bytes, 0))),
        run_(job_runner("", loaded_)),
        cancel_(cancel) {}

  /// files  cost from the files
  CostedJob cost_of(const BatchJob& job, const CostedJob& files) {
    std::vector<std::string> words = without_output(job.entry.words.unpacked());
    const auto [known, is_new] = known_.try_emplace(hash_text(PackedWords(words).text()), files);
    if (is_new) known->second = measure(job, std::move(words), files);
    return known->second;
  }

 private:
  static std::uint64_t microseconds(double seconds) {
    return static_cast<std::uint64_t>(std::clamp(std::round(1e6 * seconds), 1.0, static_cast<double>(kMaxJobCost)));
  }

  CostedJob measure(const BatchJob& job, std::vector<std::string> words, CostedJob cost) {
    constexpr double kSecondsPerByte = 1e-8;
    cost.cost = microseconds(kSecondsPerByte * static_cast<double>(cost.cost));
    cost.load = 0;
    words.push_back("--dry-run");
    const Result<Call> call = read_call(words);
    if (!call || call->layer_mm == 0) return cost;  // a job without dry runs, or one that will fail at once
    BatchJob dry;
    dry.entry.words = words;
    dry.parsed = call->parsed;
    dry.parsed = without_outputs(dry);
    CallSettings settings;
    settings.layer_bytes = job.layer_bytes;
    const double start = process_seconds();
    LoadClock loading;
    const ProgressCallback progress = [&](const ProgressEvent& event) { loading.see(event); };
    const BatchResult result = run_(dry, settings, progress, cancel_);
    double seconds = process_seconds() - start;
    // A share loads a part once; what a further variant of it takes is a cost of its job.
    if (cost.part != Hash128() && measured_.insert(cost.part).second) {
      cost.load = microseconds(loading.seconds());
      seconds -= loading.seconds();
    }
    // A job that fails in its dry run takes as long.
    cost.cost = microseconds(seconds + (result.code == 0 ? estimate_seconds(result.value) : 0));
    return cost;
  }

  std::shared_ptr<load::PartStore> loaded_;
  RunJob run_;
  const std::atomic<bool>& cancel_;
  std::map<Hash128, CostedJob, HashOrder> known_;  // by words
  std::set<Hash128, HashOrder> measured_;          // parts
};

/// The whole list, prepared without reading its input files. costs  of its files
Result<std::vector<BatchJob>> prepare_list(std::vector<BatchEntry> entries, const BatchShare& share,
                                           const BatchOptions& options, std::vector<CostedJob>& costs) {
  if (Status status = check_divided(options); !status) return status.error();
  FileCosts files;
  return prepare_batch(std::move(entries), share, read_call,
                       [&](const BatchJob&, const Call& call) { costs.push_back(files.of(call)); });
}

/// Removes the files of the shares; a share that starts meanwhile waits and then finds no plan.
Status replace_shares(const std::string& directory) {
  const Result<File> lock = lock_plan(directory);
  return lock ? remove_shares(directory) : Status(lock.error());
}

constexpr const char* kFileUnit = "bytes x layers/mm";

}  // namespace

Result<std::vector<BatchJob>> prepare_undivided(std::vector<BatchEntry> entries, const BatchShare& share,
                                                const BatchOptions& options, std::optional<BatchRecord>& record) {
  if (Status status = check_undivided(options); !status) return status.error();
  auto jobs = prepare_batch(std::move(entries), share, read_call);
  if (!jobs) return jobs;
  // Shares may have been planned, and run, meanwhile. None is planned until the record is open, and then it is refused.
  const Result<File> lock = lock_plan(options.directory);
  if (!lock) return lock.error();
  if (Status status = check_undivided(options); !status) return status.error();
  if (Status status = has_shares(options.directory) ? remove_shares(options.directory) : Status(); !status)
    return status.error();
  Result<BatchRecord> opened = BatchRecord::open(options.files(), options.resume, options.overwrite);
  if (!opened) return opened.error();
  record.emplace(std::move(*opened));
  const Status planned = record->planned(*jobs, options.overwrite);
  return planned ? std::move(jobs) : planned.error();
}

Result<std::vector<BatchJob>> prepare_share(std::vector<BatchEntry> entries, const BatchShare& share,
                                            const BatchOptions& options, const std::vector<std::string>& with,
                                            std::optional<BatchRecord>& record) {
  std::vector<CostedJob> costs;
  auto jobs = prepare_list(std::move(entries), share, options, costs);
  if (!jobs) return jobs.error();
  SharePlan own = plan_shares(*jobs, costs, options.shares, with, kFileUnit);
  own.overwrite = options.overwrite;
  const Result<SharePlan> plan = agree_on_plan(options.directory, own, options.overwrite);
  if (!plan) return plan.error();
  const auto check = [&] { return check_same_plan(options.directory, *plan); };
  Result<BatchRecord> opened = BatchRecord::open(options.files(), options.resume, options.overwrite, check);
  if (!opened) return opened.error();
  record.emplace(std::move(*opened));
  std::vector<BatchJob> chosen;
  for (std::size_t i = 0; i < jobs->size(); ++i) {
    if (plan->jobs[i].share == options.share) chosen.push_back(std::move((*jobs)[i]));
  }
  identify_jobs(chosen, share, read_call);
  const Status planned = record->planned(chosen, options.overwrite || plan->overwrite);
  return planned ? Result<std::vector<BatchJob>>(std::move(chosen)) : planned.error();
}

Result<SharePlan> plan_by_dry_runs(std::vector<BatchEntry> entries, const BatchShare& share, const BatchOptions& options,
                                   const std::vector<std::string>& with, const std::function<void(std::size_t)>& progress,
                                   const std::atomic<bool>& cancel) {
  std::vector<CostedJob> costs;
  const auto jobs = prepare_list(std::move(entries), share, options, costs);
  if (!jobs) return jobs.error();
  if (has_shares(options.directory) && !options.overwrite)
    return agree_on_plan(options.directory, plan_shares(*jobs, costs, options.shares, with, kFileUnit), false);
  DryRuns runs(options.memory_bytes, cancel);
  for (std::size_t i = 0; i < jobs->size(); ++i) {
    const BatchJob& job = (*jobs)[i];
    if (!job.refused) costs[i] = runs.cost_of(job, costs[i]);
    if (cancel) return failure(Fault::kInterrupted, "interrupted; no share is planned");
    progress(i + 1);
  }
  if (Status status = options.overwrite ? replace_shares(options.directory) : Status(); !status) return status.error();
  SharePlan plan = plan_shares(*jobs, costs, options.shares, with, kPlannedUnit);
  plan.overwrite = options.overwrite;
  return agree_on_plan(options.directory, plan, options.overwrite);
}

}  // namespace lamina::pipeline
