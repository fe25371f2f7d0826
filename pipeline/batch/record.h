// pipeline/batch/record.h: the progress of a batch, in a file that survives a kill at any moment.
//
// batch.jsonl is a journal of JSON objects (stages/support/io/journal.h): {"begun":ID,...} when a job starts, {"ended":ID,...}
// with its result when it ends. A line torn by a kill or a full disk is skipped, and its job runs again.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "pipeline/batch/job.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/file_reader.h"
#include "stages/support/io/journal.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// {"job":..., "outcome":..., ...}; the result is `value`.
Json result_json(const BatchJob& job, const BatchResult& result, const Json& value);

class BatchRecord {
 public:
  /// The record of an earlier run for one output path (or, for a job without output, for its id).
  struct Earlier {
    Hash128 begun;         // id of the last job that wrote there
    bool ended = false;    // with exit code 0
    bool unowned = false;  // it found files there that no batch had written, and did not finish
    double seconds = 0;    // these are set if it ended
    TreeDigest output;
    RecordedLine line;
  };

  /// Opens directory/batch.jsonl and creates both if absent. `resume` reads and continues the record; otherwise it starts
  /// empty.
  /// errors  kUsage: a record exists, and neither `resume` nor `overwrite` is set. kOutput: another run holds it, or the
  ///         system's reason
  static Result<BatchRecord> open(const std::string& directory, bool resume, bool overwrite);

  const Earlier* earlier(const BatchJob& job) const;
  /// Of a job that ended and is kept; any thread may call it. errors  kOutput: the record cannot be read
  Result<BatchResult> kept(const Earlier& earlier) const;

  // --- from one thread at a time; errors  kOutput
  /// unowned  the output path holds unrecorded files: a later run must not treat them as its own
  Status begun(const BatchJob& job, bool unowned);
  /// The value of the result goes; its line is noted.
  Status ended(const BatchJob& job, BatchResult& result);

 private:
  BatchRecord(std::string directory, Journal journal) : directory_(std::move(directory)), journal_(std::move(journal)) {}
  Status append(const std::string& line);

  std::string directory_;
  Journal journal_;
  std::map<Hash128, Earlier, HashOrder> earlier_;
};

/// Values of results that the record of a batch's directory has.
class RecordedValues {
 public:
  explicit RecordedValues(const std::string& directory);
  /// errors  kOutput: the record cannot be read
  Result<Json> of(const BatchResult& result) { return result.line.bytes == 0 ? Result<Json>(result.value) : at(result.line); }
  Result<Json> at(const RecordedLine& line);

 private:
  std::string path_;
  std::optional<FileReader> file_;
};

}  // namespace lamina::pipeline
