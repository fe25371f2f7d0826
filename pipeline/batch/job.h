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
#include "pipeline/text/json.h"
#include "stages/data/hash.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// What a batch adds to a command line as its job begins.
struct CallSettings {
  std::string output;                                                          // "" if the command line has none
  std::uint64_t layer_bytes = 0;                                               // for a job whose command line names no budget
  enum class Earlier { kNone, kContinue, kReplace } earlier = Earlier::kNone;  // what an earlier run has left
};

/// How a command line ended.
struct CallResult {
  int code = 0;
  std::string reason;        // one line; "" if the code is 0
  Json value;                // what the command gives; null if nothing
  bool found_whole = false;  // nothing was planned: all layers of the job were there already
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
  /// Runs it, from any thread. Progress comes from one thread at a time.
  std::function<CallResult(const CallSettings&, const ProgressCallback&, const std::atomic<bool>& cancel)> run;
};

/// Reads a command line, of one word or more. errors  kUsage: it is wrong in itself
using ReadCall = std::function<Result<Call>(const std::vector<std::string>& words)>;

struct BatchJob {
  BatchEntry entry;  // its name is the output's, and unique, if it does not name one itself
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

/// Memory that a part file may take while it is loaded and planned, from its size and format.
std::uint64_t part_bytes(const std::string& path, std::uint64_t file_bytes);

struct OutputDigest {
  std::uint64_t files = 0, bytes = 0;
  Hash128 hash;  // of names, sizes and contents
};

/// The regular files at or below `path`, in the order of their names; no file if there is none.
/// errors  kVerification if one cannot be read
Result<OutputDigest> digest_output(const std::string& path);

}  // namespace lamina::pipeline
