// pipeline/batch/record.h: what has happened in a batch so far, in a file that survives being killed at any moment.
//
// batch.jsonl grows by one JSON object a line, each with a single write: {"begun":ID,...} when a job starts,
// {"ended":ID,...} with its result when it is over. A line that a kill or a full disk has torn is skipped, and its job
// done again.
// As long as a batch runs it holds a lock on the file, which is gone with the process.
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "pipeline/batch/job.h"
#include "pipeline/text/json.h"
#include "stages/data/hash.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

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
  OutputDigest output;
  bool recognized = false;  // kept although no record knew of it: its directory holds the finished job
};

/// {"job":..., "outcome":..., ...}.
Json result_json(const BatchJob& job, std::uint32_t number, const BatchResult& result);

class BatchRecord {
 public:
  /// What an earlier run of the batch has left of a place that jobs write into (or, for a job without one, of its id).
  struct Earlier {
    Hash128 begun;         // the job that wrote there last
    bool ended = false;    // with exit code 0
    bool foreign = false;  // it found something there that no batch had written, and did not end well
    BatchResult result;    // if it ended
  };

  /// Opens directory/batch.jsonl, which is created with the directory. With `resume` what it says is read and it is
  /// continued, else it begins anew.
  /// errors  kUsage: there is one already, and neither `resume` nor `overwrite`. kOutput: another run holds it, or the
  ///         system's reason
  static Result<BatchRecord> open(const std::string& directory, bool resume, bool overwrite);
  BatchRecord(BatchRecord&& other) noexcept;
  BatchRecord& operator=(BatchRecord&&) = delete;
  ~BatchRecord();

  const Earlier* earlier(const BatchJob& job) const;

  // --- from one thread at a time; errors  kOutput
  /// foreign  what lies in its place is not on record: a later run must not take it for its own
  Status begun(const BatchJob& job, std::uint32_t number, bool foreign);
  Status ended(const BatchJob& job, std::uint32_t number, const BatchResult& result);

 private:
  BatchRecord() = default;
  Status append(const Json& entry);

  std::string path_;
  int file_ = -1;
  bool torn_ = false;  // the file does not end with a line's end
  std::map<std::string, Earlier> earlier_;
};

}  // namespace lamina::pipeline
