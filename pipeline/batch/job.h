// pipeline/batch/job.h: a job of a batch made ready to run: what it writes, what it reads, what it needs.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/batch/list.h"
#include "pipeline/plan/progress.h"
#include "stages/data/hash.h"
#include "stages/data/status.h"
#include "stages/text/json.h"

namespace lamina::pipeline {

/// What a batch adds to a command line as its job begins.
struct CallSettings {
  std::string output;                                                          // "" if the command line has none
  std::uint64_t layer_bytes = 0;                                               // for a job whose command line names no budget
  enum class Earlier { kNone, kContinue, kReplace } earlier = Earlier::kNone;  // what an earlier run has left
};

enum class BatchOutcome {
  kDone,       // ended with exit code 0
  kKept,       // done before, and its output is still what it was
  kFailed,     // ended with another exit code
  kTimeLimit,  // stopped because it took too long
  kStopped,    // stopped because the batch was
  kNotRun      // its turn never came
};

std::string_view outcome_name(BatchOutcome outcome);

struct BatchResult {
  BatchOutcome outcome = BatchOutcome::kNotRun;
  int code = 0;        // of the command; 3 beyond the time limit
  std::string reason;  // one line, of what is not done
  Json value;          // what the command gave; null if nothing
  double seconds = 0;
  TreeDigest output;
  bool recognized = false;  // kept although no record knew of it: its directory holds the finished job

  /// Whether it is the job's own fault that it is not done: not that of whoever stopped the batch.
  bool failed() const { return outcome == BatchOutcome::kFailed || outcome == BatchOutcome::kTimeLimit; }
};

/// A command line as a batch sees it.
struct Call {
  std::string output;               // that it names; "" if it names none
  bool output_of_job_file = false;  // it is relative to the directory that the batch was started in, not to the batch's
  /// Ending of the name that its output gets if it names none, "" for a directory. Absent: its result is what it gives.
  std::optional<std::string> ending;
  bool can_continue = false, can_replace = false;  // what an earlier run has left
  std::optional<std::uint64_t> layer_bytes;        // budget that it names; 0 if it takes one and names none
  std::vector<std::string> inputs;                 // texts of the command line that may name files it reads
  /// Runs it, from any thread. Progress comes from one thread at a time. returns  code, reason and value, and whether all
  /// layers of the job were there already; the queue tells the rest
  std::function<BatchResult(const CallSettings&, const ProgressCallback&, const std::atomic<bool>& cancel)> run;
};

/// Reads a command line, of one word or more. errors  kUsage: it is wrong in itself
using ReadCall = std::function<Result<Call>(const std::vector<std::string>& words)>;

struct BatchJob {
  std::uint32_t number = 0;  // from 1
  BatchEntry entry;          // its name is the output's, and unique, if it does not name one itself
  Call call;
  std::string output;             // file or directory that it writes; empty if its result is what it gives
  std::string place;              // the output for reports: below the batch's directory, else as it was given
  bool relative_output = false;   // its output was given relative to the batch's directory
  std::uint64_t layer_bytes = 0;  // for the layers in flight
  std::uint64_t need_bytes = 0;   // most memory that it is expected to hold
  Hash128 id;                     // of the version, the words, the output's place and every file that it reads
  std::optional<Error> refused;   // it is wrong in itself: it fails at its turn, the others run
};

struct BatchShare {
  std::string directory;          // of the batch
  std::uint64_t layer_bytes = 0;  // of every job that names no budget
};

/// Makes the jobs ready, in the order of the entries. Nothing is written.
/// errors  kUsage: two jobs write into the same place, or one into the other's (both are named); a job writes where the
///         batch keeps its own files; a relative output leads out of the batch's directory
/// cost    reads every file that a job names once, to tell later whether it has changed
Result<std::vector<BatchJob>> prepare_batch(std::vector<BatchEntry> entries, const BatchShare& share, const ReadCall& read);

}  // namespace lamina::pipeline
