// pipeline/batch/record.h: what has happened in a batch so far, in a file that survives being killed at any moment.
//
// batch.jsonl is a journal of JSON objects (stages/write/journal.h): {"begun":ID,...} when a job starts, {"ended":ID,...}
// with its result when it is over. A line that a kill or a full disk has torn is skipped, and its job done again.
#pragma once

#include <map>
#include <string>

#include "pipeline/batch/job.h"
#include "stages/data/hash.h"
#include "stages/data/status.h"
#include "stages/text/json.h"
#include "stages/write/journal.h"

namespace lamina::pipeline {

/// {"job":..., "outcome":..., ...}.
Json result_json(const BatchJob& job, const BatchResult& result);

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

  const Earlier* earlier(const BatchJob& job) const;

  // --- from one thread at a time; errors  kOutput
  /// foreign  what lies in its place is not on record: a later run must not take it for its own
  Status begun(const BatchJob& job, bool foreign);
  Status ended(const BatchJob& job, const BatchResult& result);

 private:
  explicit BatchRecord(write::Journal journal) : journal_(std::move(journal)) {}
  Status append(const Json& entry);

  write::Journal journal_;
  std::map<std::string, Earlier> earlier_;
};

}  // namespace lamina::pipeline
