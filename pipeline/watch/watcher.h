// pipeline/watch/watcher.h: plans the files of a watched folder as they become complete.
//
// A job is begun, planned, published and moved, and each step is recorded (record.h): after a kill the next run continues it
// where it was. It is planned in a hidden folder of the output; its inputs are hashed before and after, and a result of inputs
// that changed meanwhile is discarded.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "pipeline/batch/job.h"
#include "pipeline/watch/record.h"
#include "pipeline/watch/settings.h"
#include "stages/data/status.h"

namespace lamina::load {
class PartStore;
}

namespace lamina::pipeline {

struct WatchOptions {
  std::string folder, output;  // watched; of results and of the record
  std::string done, failed;    // where planned files are moved; "": done/ and failed/ in the watched folder
  FolderSettings settings;     // of the whole folder
  double poll_seconds = 1, time_limit_seconds = 0, then_limit_seconds = 600;  // of planning, of the command; 0: none
  std::uint32_t jobs = 1;                                                     // running at a time
  std::uint64_t memory_bytes = 1ull << 30;
  bool once = false;                        // ends when nothing is left to do
  std::shared_ptr<load::PartStore> loaded;  // parts that jobs share, as in a batch
};

/// What happens, for the console; called by the thread that called watch_folder().
struct WatchObserver {
  std::function<void(const std::string& line)> note;   // waiting files, problems of the folder
  std::function<void(const WatchedJob& job)> planned;  // or failed
  std::function<void(const WatchedJob& job, std::optional<int> then_code)> ended;
  std::function<void(const Error& error)> failed;  // of the watcher, which continues
};

struct WatchSummary {
  std::uint32_t done = 0, failed = 0;
  int code = 0;                      // of the first job that failed
  Fault left = Fault::kInterrupted;  // why a file is left, of a watcher that ends by itself; kInterrupted: none is
  std::optional<Error> problem;      // that ended the watcher: the record cannot be written, the folder not be read
  bool interrupted = false;
  bool abandoned = false;  // a job that ignored its stop is still running: the program must exit without waiting for it
};

/// Watches until `interrupt` is set, or, with options.once, until nothing is left to do.
/// A job starts when its expected memory fits next to the running jobs, or when none is running, as in a batch.
/// errors  kUsage: the folders; kOutput: another watcher has one of them, the record cannot be written
Result<WatchSummary> watch_folder(const WatchOptions& options, const ReadCall& read, const RunJob& run,
                                  const WatchObserver& observer, const std::atomic<bool>& interrupt);

}  // namespace lamina::pipeline
