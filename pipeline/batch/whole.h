// pipeline/batch/whole.h: a batch as the records in its directory describe it, and its shares merged into one batch.
#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "pipeline/batch/record.h"
#include "stages/data/status.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// Progress of a share, or of an undivided batch.
struct ShareState {
  std::uint32_t number = 0;  // 0: not divided
  std::size_t jobs = 0, done = 0, failed = 0;
  bool started = false, running = false;

  std::size_t missing() const { return jobs - done - failed; }
  bool is_open() const { return missing() > 0 || running || (number == 0 && !started); }
};

struct BatchDirectory {
  std::string directory;
  std::uint32_t shares = 0;         // 0: not divided
  std::vector<ShareState> states;   // one per share, or one
  std::vector<RecordedJob> jobs;    // that ended, in the order of the list
  std::vector<std::uint32_t> from;  // of each of them its share, 0: not divided

  /// kVerification while a share is missing or running, else the exit code of the batch.
  int code() const;
};

/// Whether a batch wrote the directory, in shares or not.
bool is_batch_directory(const std::string& directory);

/// Reads the records; also of a batch that is running. Changes nothing.
/// errors  kUsage: no directory of a batch; kVerification: shares.tsv is damaged; kOutput: a record cannot be read
/// cost    reads every record once
Result<BatchDirectory> read_batch_directory(const std::string& directory);

/// Progress as text, a line per share, and as JSON.
std::string status_text(const BatchDirectory& batch);
Json status_json(const BatchDirectory& batch);

/// What is missing, one line per share: "share 3 of 20: never started; run it with --shard 3/20".
std::vector<std::string> missing_lines(const BatchDirectory& batch);

/// Makes batch.jsonl, summary.json and summary.tsv from all shares, as an undivided batch writes them, then removes the plan.
/// No share is missing or running. The caller has the lock of the plan (shares.h) since it has read the batch, and calls
/// remove_merged_shares() without it.
/// schema  of summary.json
/// errors  kOutput; kInterrupted: `cancel` was set before batch.jsonl was complete, and nothing is written
Status merge_shares(const BatchDirectory& batch, std::int64_t schema, const FileOptions& how, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
