// pipeline/output/merge.h: the shards of a job become the job.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct MergeReport {
  std::string output;
  std::uint32_t shards = 0;
  std::uint64_t layers = 0;
  std::uint64_t linked = 0, copied = 0;  // files; the others were in place
};

/// Joins the shards (or ranges) of one job that lie in one or several directories into `output`, whose manifest.json is
/// then byte for byte that of a run that was never divided. Files in other directories are linked, or copied where the
/// file system cannot link; those directories stay as they are. In `output` itself the shards' manifests are removed
/// once manifest.json is there.
///
/// errors  kVerification, one line: a shard of another job, layers that no shard or that two shards hold, a shard that
///         is not finished, a file that is missing or of the wrong size. kUsage if a directory does not exist or holds
///         another job's manifest.json. kOutput
Result<MergeReport> merge(const std::vector<std::string>& directories, const std::string& output);

}  // namespace lamina::pipeline
