#include "pipeline/batch/check_batch.h"

#include <fmt/format.h>

#include "pipeline/batch/whole.h"
#include "pipeline/manifest/layer_files.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"
#include "stages/support/text/readable.h"

namespace lamina::pipeline {
namespace {

bool has_manifest(const std::string& output) { return is_file(output + ".json") || !find_manifests(output).empty(); }

void check_job(const RecordedJob& job, const VerifyOptions& options, BatchCheck& check) {
  const auto fault = [&](const std::string& what) {
    check.add(one_line(fmt::format("{}: {}: {}", job.job.entry.source, job.job.position(), what)));
  };
  const TreeDigest& recorded = job.result.output;
  const std::string& output = job.job.output;
  const Result<TreeDigest> found = digest_tree(output);
  if (!found) return fault(found.error().message);
  if (found->files == 0 && recorded.files > 0) return fault("is missing");
  if (found->files != recorded.files) return fault(fmt::format("has {} files, recorded are {}", found->files, recorded.files));
  if (found->bytes != recorded.bytes) return fault(fmt::format("has {} bytes, recorded are {}", found->bytes, recorded.bytes));
  if (found->hash != recorded.hash) return fault("has other contents than recorded");
  if (!has_manifest(output)) return;
  const Result<VerifyReport> report = verify(output, options);
  if (!report) return fault(report.error().message);
  for (const std::string& text : report->faults) fault(text);
  check.fault_count += report->fault_count - report->faults.size();
}

}  // namespace

Result<BatchCheck> check_batch(const std::string& directory, const VerifyOptions& options) {
  const Result<BatchDirectory> batch = read_batch_directory(directory);
  if (!batch) return batch.error();
  BatchCheck check;
  for (const RecordedJob& job : batch->jobs) {
    ++check.jobs;
    check.failed += job.result.failed();
    check.files += job.result.output.files;
    check.bytes += job.result.output.bytes;
    if (!job.result.failed() && !job.job.output.empty()) check_job(job, options, check);
  }
  for (const std::string& line : missing_lines(*batch)) check.add(line);
  return check;
}

}  // namespace lamina::pipeline
