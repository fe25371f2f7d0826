// pipeline/batch/summary.h: what a batch did, for a person, for a table and for a script.
#pragma once

#include <string>
#include <vector>

#include "pipeline/batch/queue.h"
#include "stages/text/json.h"

namespace lamina::pipeline {

/// The exit code: 0 if every job is done or kept, 130 if the batch was interrupted, else that of the first job of the
/// list that failed.
int batch_code(const BatchSummary& summary);

/// summary.json: one object.
Json batch_json(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options);

/// summary.tsv: a line of names, then one a job: job, outcome, code, seconds, files, bytes, output, source, reason.
std::string batch_table(const std::vector<BatchJob>& jobs, const BatchSummary& summary);

/// The line of a job as it ends: "[3/200] done     bracket: 51 files, 1.2 MB, 0.35 s".
std::string job_line(const BatchJob& job, const BatchResult& result, std::uint32_t ended, std::uint32_t total);

/// Where a job that failed was asked for and why it failed: "jobs.txt:3: part.stl: no such file".
std::string failure_line(const BatchJob& job, const BatchResult& result);

/// What stands behind the bar: "12/200 jobs, 1 failed; bracket 40/120 layers".
std::string progress_line(const BatchState& state);

/// The end: totals, and each job that failed.
std::string batch_text(const std::vector<BatchJob>& jobs, const BatchSummary& summary, const BatchOptions& options);

}  // namespace lamina::pipeline
