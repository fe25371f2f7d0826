// pipeline/batch/record.h: the progress of a batch, in a file that survives a kill at any moment.
//
// batch.jsonl is a journal of JSON objects (stages/support/io/journal.h): {"jobs":N} when a batch starts, {"plan":GENERATION}
// when a share starts, {"begun":ID,...} when a job starts, {"ended":ID,...} with its result when it ends. A line torn by a kill
// or a full disk is skipped, and its job runs again.
#pragma once

#include <functional>
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

/// The files of a batch, or of one share of it, in the directory of the batch.
struct BatchFiles {
  BatchFiles(std::string of, std::uint32_t number = 0, std::uint32_t count = 0)
      : directory(std::move(of)), share(number), shares(count) {}

  std::string record() const { return path("batch", ".jsonl"); }  // DIR/batch.jsonl, DIR/batch-2-of-4.jsonl
  std::string summary() const { return path("summary", ".json"); }
  std::string table() const { return path("summary", ".tsv"); }

  std::string directory;
  std::uint32_t share, shares;  // from 1; 0: not divided

 private:
  std::string path(std::string_view name, std::string_view ending) const;
};

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

  /// Opens the record and creates it and its directory if absent. `resume` reads and continues the record; otherwise it
  /// starts empty.
  /// plan    for a share, called while the record is open: returns the generation of its plan. A record of another one is
  ///         replaced; an error leaves the record
  /// errors  kUsage: a record exists, and neither `resume` nor `overwrite` is set. kOutput: another run holds it, or the
  ///         system's reason; of `plan`
  static Result<BatchRecord> open(const BatchFiles& files, bool resume, bool overwrite,
                                  const std::function<Result<Hash128>()>& plan = {});

  const Earlier* earlier(const BatchJob& job) const;
  /// Whether outputs that the record does not know are replaced: planned() decides.
  bool replaces() const { return replaces_; }
  /// Of a job that ended and is kept; any thread may call it. errors  kOutput: the record cannot be read
  Result<BatchResult> kept(const Earlier& earlier) const;

  // --- from one thread at a time; errors  kOutput
  /// The list of this run. Of earlier runs counts what has ended and is of the same job now, until the job begins again.
  /// overwrite  what is where the jobs write is replaced, also by later runs of this list that continue the record
  Status planned(const std::vector<BatchJob>& jobs, bool overwrite);
  /// unowned  the output path holds unrecorded files: a later run must not treat them as its own
  Status begun(const BatchJob& job, bool unowned);
  /// The value of the result goes; its line is noted.
  Status ended(const BatchJob& job, BatchResult& result);

 private:
  BatchRecord(BatchFiles files, Journal journal) : files_(std::move(files)), journal_(std::move(journal)) {}
  Status append(const std::string& line);

  BatchFiles files_;
  Journal journal_;
  std::map<Hash128, Earlier, HashOrder> earlier_;
  std::optional<Hash128> replacing_;  // words of the list of an earlier run with --overwrite
  bool replaces_ = false;
};

/// Values of results that a record has.
class RecordedValues {
 public:
  explicit RecordedValues(const BatchFiles& files) : path_(files.record()) {}
  /// errors  kOutput: the record cannot be read
  Result<Json> of(const BatchResult& result) { return result.line.bytes == 0 ? Result<Json>(result.value) : at(result.line); }
  Result<Json> at(const RecordedLine& line) {
    Result<std::string> text = line_at(line);
    return text ? value_in(*text) : text.error();
  }
  /// The line itself, without its end.
  Result<std::string> line_at(const RecordedLine& line);

 private:
  Result<Json> value_in(const std::string& line) const;

  std::string path_;
  std::optional<FileReader> file_;
};

/// What a record has of a job in the list of the last run.
struct RecordedJob {
  BatchJob job;        // number, entry, id; its output is the position
  BatchResult result;  // its value remains in the record
  RecordedLine begun;  // empty if the job was recognized, not run
  bool ended = false;
  bool elsewhere = false;  // its output is relative to the working directory
};

struct RecordedBatch {
  std::size_t planned = 0;                    // jobs in that list; 0 if unknown
  std::optional<Hash128> plan;                // generation of the plan of a share
  std::map<std::uint32_t, RecordedJob> jobs;  // of the list of the last run, by number
};

/// Reads a record, also of a batch that is running, and changes nothing. errors  kOutput: it cannot be read
Result<RecordedBatch> read_record(const BatchFiles& files);

}  // namespace lamina::pipeline
