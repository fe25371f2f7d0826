// pipeline/cache/cached_run.h: runs a job, or takes its files from a cache.
#pragma once

#include <atomic>
#include <optional>

#include "pipeline/cache/store.h"
#include "pipeline/plan/plan.h"
#include "pipeline/plan/progress.h"
#include "pipeline/report/summary.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"

namespace lamina::pipeline {

struct CachedRun {
  Summary summary;
  /// Of all files of the output, as digest_tree(); absent if they are not all known.
  std::optional<TreeDigest> files;
};

/// As run() (pipeline/run/run.h), with the same files. The files of an equal job are taken from the cache; the manifest, which
/// has the names of the parts, is written anew. Otherwise the job runs and is added to the cache, unless its parts changed
/// meanwhile. A job that --resume continues runs. A cache that fails costs time only: the job runs, and the summary has a note.
/// The summary states in facts["cache"] whether the job was a "hit", is "added", or why it is not cached.
/// errors  those of run()
/// cost    of a hit: reads and writes each file once
Result<CachedRun> run_with_cache(JobCache& cache, Resolved resolved, const ProgressCallback& progress,
                                 const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
