// pipeline/batch/queue.h: many jobs in one process: one pool of threads, one start, one budget of memory.
//
// Jobs begin in the order of the list, so many at a time. A job begins when what it is expected to need fits beside what the
// running jobs may hold, or when none is running: a job that alone exceeds the budget runs alone.
// A job that fails is reported and the others go on. Whatever ends the program loses none of the finished jobs: each is
// on record when it ends (record.h).
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "pipeline/batch/record.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct BatchOptions {
  std::string directory;
  std::uint32_t jobs = 1;  // running at a time
  std::uint64_t memory_bytes = 1ull << 30;
  double time_limit_seconds = 0;  // of each job; 0: none
  bool fail_fast = false;         // the first failure stops all
  bool resume = false, overwrite = false;
};

/// A running job, for whoever watches.
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
  /// Once for every job, as it ends. Both are called by the thread that called run_batch.
  std::function<void(const BatchJob&, const BatchResult&, const BatchState&)> ended;
};

struct BatchSummary {
  std::vector<BatchResult> results;  // one a job
  std::uint32_t most_running = 0;
  std::uint64_t most_need_bytes = 0;  // of the jobs that ran together
  double seconds = 0;
  bool interrupted = false;
  /// A job that could not be stopped is still running: the program has to end without waiting for it.
  bool abandoned = false;
};

/// The layers' share of the budget for each of `jobs` jobs.
std::uint64_t layer_share(std::uint64_t memory_bytes, std::uint32_t jobs);

/// Runs the jobs. `interrupt` stops the batch: running jobs are told to stop, and nothing new begins.
/// errors  kOutput if the record could not be written; jobs that are done stay done
Result<BatchSummary> run_batch(std::vector<BatchJob> jobs, BatchRecord record, const BatchOptions& options,
                               const BatchWatcher& watcher, const std::atomic<bool>& interrupt);

}  // namespace lamina::pipeline
