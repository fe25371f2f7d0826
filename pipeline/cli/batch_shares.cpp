#include "pipeline/cli/batch_shares.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <utility>

#include "pipeline/batch/record.h"
#include "pipeline/batch/shares.h"
#include "pipeline/cli/job_call.h"
#include "pipeline/job/errors.h"

namespace lamina::pipeline {
namespace {

/// errors  kUsage: the directory belongs to a batch that is not divided, and is not overwritten
Status check_divided(const BatchOptions& options) {
  if (options.overwrite || has_shares(options.directory) || !has_undivided_batch(options.directory)) return {};
  return usage(
      "{}: belongs to a batch without shares; continue it without shares, replace it with --overwrite, or name another directory",
      BatchFiles(options.directory).record());
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

/// Seconds of the layers of a job on one processor, from the summary of its dry run: a sum of what layers, and pixels or area
/// take. The factors were fitted to jobs of shared/models within a factor of 3 (bench/shares.md); shares need their ratios
/// only. 0: the summary is not that of a job with parts
double estimate_seconds(const Json& summary) try {
  const auto number = [&](std::string_view name) {
    const Json* member = summary.find(name);
    return member == nullptr ? 0.0 : member->get<double>();
  };
  const std::string& command = summary.at("command").text();
  const double triangles = number("triangles"), layers = number("layers_total"), pixels = number("columns") * number("rows");
  double area_mm2 = 0;  // of the boxes around the parts
  for (const Json& part : summary.at("parts")) {
    const Json &lo = part.at("bounds_mm").at("lo"), &hi = part.at("bounds_mm").at("hi");
    const auto side_mm = [&](std::size_t axis) { return hi.at(axis).get<double>() - lo.at(axis).get<double>(); };
    area_mm2 += part.at("copies").get<double>() * side_mm(0) * side_mm(1);
  }
  if (command == "jet") return layers * (3e-5 + 2e-11 * pixels);
  if (command == "slice") return layers * 3e-6 * std::sqrt(triangles);
  return layers * (1e-4 + 5e-6 * std::sqrt(triangles) + 6e-7 * area_mm2);
} catch (const JsonError&) {
  return 0;
}

/// Costs in microseconds by dry runs.
class DryRuns {
 public:
  explicit DryRuns(const std::atomic<bool>& cancel) : run_(job_runner("", {})), cancel_(cancel) {}

  /// files  cost from the files
  std::uint64_t cost_of(const BatchJob& job, const CostedJob& files) {
    constexpr double kSecondsPerByte = 1e-8;
    const auto microseconds = [](double seconds) {
      return static_cast<std::uint64_t>(std::clamp(std::round(1e6 * seconds), 1.0, static_cast<double>(kMaxJobCost)));
    };
    std::vector<std::string> words = without_output(job.entry.words.unpacked());
    const auto [known, is_new] = known_.try_emplace(hash_text(PackedWords(words).text()), 0);
    if (!is_new) return known->second;
    known->second = microseconds(kSecondsPerByte * static_cast<double>(files.cost));
    words.push_back("--dry-run");
    const Result<Call> call = read_call(words);
    if (!call || call->layer_mm == 0) return known->second;  // a job without dry runs, or one that will fail at once
    BatchJob dry;
    dry.entry.words = words;
    dry.parsed = call->parsed;
    CallSettings settings;
    settings.layer_bytes = job.layer_bytes;
    // A dry run takes as long as loading; a job that fails in it ends then.
    const auto start = std::chrono::steady_clock::now();
    const ProgressCallback ignored = [](const ProgressEvent&) {};
    const BatchResult result = run_(dry, settings, ignored, cancel_);
    const double load_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    known->second = microseconds(load_seconds + (result.code == 0 ? estimate_seconds(result.value) : 0));
    return known->second;
  }

 private:
  RunJob run_;
  const std::atomic<bool>& cancel_;
  std::map<Hash128, std::uint64_t, HashOrder> known_;  // by words
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
  if (!has_shares(directory)) return remove_shares(directory);
  const Result<File> lock = lock_plan(directory);
  return lock ? remove_shares(directory) : Status(lock.error());
}

constexpr const char* kFileUnit = "bytes x layers/mm";

}  // namespace

Result<std::vector<BatchJob>> prepare_undivided(std::vector<BatchEntry> entries, const BatchShare& share,
                                                const BatchOptions& options, std::optional<BatchRecord>& record) {
  if (has_shares(options.directory) && !options.overwrite) {
    return usage(
        "{}: belongs to a batch in shares; continue it with --shard, join it with lamina merge, or replace it with --overwrite",
        plan_path(options.directory));
  }
  auto jobs = prepare_batch(std::move(entries), share, read_call);
  if (!jobs) return jobs;
  if (Status status = has_shares(options.directory) ? replace_shares(options.directory) : Status(); !status)
    return status.error();
  Result<BatchRecord> opened = BatchRecord::open(options.files(), options.resume, options.overwrite);
  if (!opened) return opened.error();
  record.emplace(std::move(*opened));
  const Status planned = record->planned(jobs->size());
  return planned ? std::move(jobs) : planned.error();
}

Result<std::vector<BatchJob>> prepare_share(std::vector<BatchEntry> entries, const BatchShare& share,
                                            const BatchOptions& options, const std::vector<std::string>& with,
                                            std::optional<BatchRecord>& record) {
  std::vector<CostedJob> costs;
  auto jobs = prepare_list(std::move(entries), share, options, costs);
  if (!jobs) return jobs.error();
  const SharePlan own = plan_shares(*jobs, costs, options.shares, with, kFileUnit);
  if (options.overwrite) {
    if (Status status = remove_undivided_batch(options.directory); !status) return status.error();
  }
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
  return chosen;
}

Result<SharePlan> plan_by_dry_runs(std::vector<BatchEntry> entries, const BatchShare& share, const BatchOptions& options,
                                   const std::vector<std::string>& with, const std::function<void(std::size_t)>& progress,
                                   const std::atomic<bool>& cancel) {
  std::vector<CostedJob> costs;
  const auto jobs = prepare_list(std::move(entries), share, options, costs);
  if (!jobs) return jobs.error();
  if (has_shares(options.directory) && !options.overwrite)
    return agree_on_plan(options.directory, plan_shares(*jobs, costs, options.shares, with, kFileUnit), false);
  DryRuns runs(cancel);
  for (std::size_t i = 0; i < jobs->size(); ++i) {
    const BatchJob& job = (*jobs)[i];
    if (!job.refused) costs[i].cost = runs.cost_of(job, costs[i]);
    if (cancel) return failure(Fault::kInterrupted, "interrupted; no share is planned");
    progress(i + 1);
  }
  for (const auto& remove : {replace_shares, remove_undivided_batch}) {
    if (Status status = options.overwrite ? remove(options.directory) : Status(); !status) return status.error();
  }
  return agree_on_plan(options.directory, plan_shares(*jobs, costs, options.shares, with, kPlannedUnit), false);
}

}  // namespace lamina::pipeline
