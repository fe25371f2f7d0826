// pipeline/batch/summary.h: the results of a batch as text, as a table and as JSON.
#pragma once

#include <string>
#include <vector>

#include "pipeline/batch/queue.h"
#include "stages/support/io/file.h"
#include "stages/support/text/json_value.h"

namespace lamina::pipeline {

/// The text on one line without tabs, for a table.
std::string table_cell(std::string_view text);

/// The exit code: 0 if every job is done or kept, 130 if the batch was interrupted, else the code of the first failed
/// job in the list.
int batch_code(const BatchSummary& summary);

/// summary.json: one object, in pieces. Values that the record has are read when they are written.
/// schema  its first member
/// indent  of json_text()
/// errors  kOutput: the record cannot be read; of `append`
Status write_batch_json(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options,
                        std::int64_t schema, int indent, const std::function<Status(std::string_view)>& append);

/// Writes the summary and the table of a batch or a share. errors  kOutput
Status write_summaries(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options,
                       std::int64_t schema, const FileOptions& how);

/// summary.tsv: a header, then one line per job: job, outcome, code, seconds, files, bytes, output, source, reason.
std::string batch_table(const std::vector<BatchJob>& jobs, const BatchSummary& summary);

/// The line of a finished job: "[3/200] done     bracket: 51 files, 1.2 MB, 0.35 s".
std::string job_line(const BatchJob& job, const BatchResult& result, std::uint32_t ended, std::uint32_t total);

/// Source and reason of a failed job: "jobs.txt:3: part.stl: no such file".
std::string failure_line(const BatchJob& job, const BatchResult& result);

/// The text after the progress bar: "12/200 jobs, 1 failed; bracket 40/120 layers".
std::string progress_line(const BatchState& state);

/// The final text: totals and every failed job.
std::string batch_text(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options);

}  // namespace lamina::pipeline
