// pipeline/run/merge.h: merges the shards of a job.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::pipeline {

struct MergeReport {
  std::string output;
  std::uint32_t shards = 0;  // 0 if the directory was whole already
  std::uint64_t layers = 0;
  std::uint64_t linked = 0, copied = 0;  // files; the others were in place
  std::int64_t microseconds = 0;         // of the machine, by the records; 0 without one, or if some have no time
  std::vector<Warning> warnings;         // of the whole job
};

struct MergeRequest {
  std::vector<std::string> directories;
  std::string output;
  bool strict = false, allow_empty = false;
};

/// Merges the shards (or ranges) of one job from one or several directories into `output`. Its manifest.json equals that
/// of an undivided run byte for byte. Files in other directories are linked, or copied where the file system cannot
/// link; those directories do not change. In `output` the shards' manifests are removed once manifest.json exists. Where
/// `output` alone is named and is whole already, of an earlier merge or undivided, only the sizes of its files are checked.
/// The whole job is judged by its records before anything is written (stages/checks/layer_warnings.h).
///
/// errors  kVerification, one line: a shard of another job or of contours, missing or duplicate layers, an unfinished
///         shard, a file that is missing, a link, or of the wrong size, a strict job with warnings. kUsage: no such directory;
///         `output` holds another job's manifest, or layers without one. kInput: no layer has a pixel. kOutput
Result<MergeReport> merge(const MergeRequest& request);

}  // namespace lamina::pipeline
