// pipeline/batch/queue.h: many jobs in one process, sharing a thread pool and a memory budget.
//
// Jobs start in list order, up to a fixed number at a time. A job starts when its expected memory fits next to the running
// jobs, or when none is running: a job that exceeds the budget runs alone.
// The disk works while the next jobs run: the files of jobs that ended meanwhile are synced at once, and then they are
// recorded. A failed job is reported and the others continue. Each job is recorded as it ends (record.h), so a crash loses no
// finished job.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "pipeline/batch/record.h"
#include "stages/data/status.h"

namespace lamina::load {
class PartStore;
}

namespace lamina::pipeline {

struct BatchOptions {
  std::string directory;
  std::uint32_t share = 0, shares = 0;  // of BatchFiles
  std::uint32_t jobs = 1;               // running at a time
  std::uint64_t memory_bytes = 1ull << 30;
  double time_limit_seconds = 0;  // of each job; 0: none
  bool fail_fast = false;         // the first failure stops the batch
  bool resume = false, overwrite = false;
  /// Files of finished jobs are synced in groups, before the record has their end; else each job syncs its own.
  bool sync_in_groups = false;
  std::shared_ptr<load::PartStore> loaded;  // parts that jobs share; its limit follows the memory of running jobs

  BatchFiles files() const { return {directory, share, shares}; }
};

/// A running job, for the observer.
struct RunningJob {
  std::string name;
  std::uint32_t layers_done = 0, layers = 0;  // 0 of 0 before the first layer
};

struct BatchState {
  std::uint32_t ended = 0, failed = 0, total = 0;
  std::vector<RunningJob> running;
};

struct BatchWatcher {
  /// Several times a second.
  std::function<void(const BatchState&)> progress;
  /// Once per job, when it ends. The thread that called run_batch makes both calls.
  std::function<void(const BatchJob&, const BatchResult&, const BatchState&)> ended;
};

struct BatchSummary {
  std::vector<BatchResult> results;  // one a job; values that the record has are left there
  std::uint32_t max_running = 0;
  std::uint64_t max_need_bytes = 0;       // of jobs running at the same time
  std::uint64_t peak_resident_bytes = 0;  // of the program, when the last job has ended
  double seconds = 0;
  bool interrupted = false;
  /// A job that ignored its stop is still running: the program must exit without waiting for it.
  bool abandoned = false;
};

/// Memory for the parts that jobs share: a quarter of all, and no more than running jobs leave. need_bytes  of these
std::uint64_t loaded_share(std::uint64_t memory_bytes, std::uint64_t need_bytes);

/// Layer budget of each of `jobs` concurrent jobs.
std::uint64_t layer_share(std::uint64_t memory_bytes, std::uint32_t jobs);

/// Runs the jobs. `interrupt` stops the batch: running jobs are cancelled and no new job starts.
/// errors  kOutput if the record cannot be written; finished jobs stay finished
/// jobs  outlive the call where a job ignores its stop
Result<BatchSummary> run_batch(std::shared_ptr<const std::vector<BatchJob>> jobs, BatchRecord record,
                               const BatchOptions& options, const RunJob& run, const BatchWatcher& watcher,
                               const std::atomic<bool>& interrupt);

}  // namespace lamina::pipeline
