// pipeline/watch/planning.h: one job of a watched folder, from its inputs to its recorded end.
#pragma once

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "pipeline/watch/candidates.h"
#include "pipeline/watch/watcher.h"

namespace lamina::pipeline {

/// What the jobs of a watcher share.
struct WatchShared {
  std::string folder, done, failed;  // watched; of planned files
  RunJob run;
  double time_limit_seconds = 0, then_limit_seconds = 0;  // 0: none
  std::mutex mutex;                                       // guards what follows, and names of results
  std::optional<WatchRecord> record;
  std::map<std::string, std::set<std::string>> used;  // by which jobs each file is read (Candidates)
  std::set<std::string> moving;                       // jobs that use nothing any more
};

/// A job with what only its planning needs.
struct WatchTask {
  WatchedJob job;
  BatchJob call;                 // command line; empty if the job is planned already
  std::uint64_t need_bytes = 0;  // expected peak memory
  std::chrono::steady_clock::time_point begun;
  std::atomic<bool> cancel{false}, stop{false};  // the planning, after its time limit; all, with the watcher, which sets both
  std::atomic<bool> in_command{false};
  // --- results
  enum class End {
    kEnded,    // recorded as ended
    kChanged,  // an input changed: nothing is left of the job
    kStopped,  // continues with the next run
    kRetry     // planned, but not published, moved or ended, or not planned for lack of space; see `problem`
  };
  End end = End::kStopped;
  std::optional<Error> problem;
  std::optional<int> then_code;
  bool fatal = false;  // the record cannot be written
  int shortages = 0;   // of memory, so far
};

/// Reads the command line of a candidate; its error becomes that of the job. Reads no part.
void prepare_task(const Candidate& candidate, Folder& folder, std::uint64_t layer_bytes, const ReadCall& read, WatchTask& task);

/// Does what is left of a job. `planned` is called once its result is recorded, by this thread.
void run_task(WatchShared& shared, WatchTask& task, const std::function<void()>& planned);

}  // namespace lamina::pipeline
