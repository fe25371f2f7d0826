// pipeline/cli/batch_shares.h: prepares the jobs of `lamina batch`: all of them, or those of one share.
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "pipeline/batch/queue.h"
#include "pipeline/batch/record.h"
#include "pipeline/batch/shares.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// All jobs of a batch that is not divided.
/// record  is set, open
/// errors  those of prepare_batch() and BatchRecord::open(); kUsage: the directory belongs to a batch in shares, unless it is
///         overwritten; kOutput: such a share is running
Result<std::vector<BatchJob>> prepare_undivided(std::vector<BatchEntry> entries, const BatchShare& share,
                                                const BatchOptions& options, std::optional<BatchRecord>& record);

/// The jobs of one share. Names and collisions are those of the whole list; only the input files of the share are read.
/// The first process of a batch writes the plan of its shares (pipeline/batch/shares.h).
/// record  is set, open
/// errors  those of prepare_batch(), agree_on_plan(), check_same_plan() and BatchRecord::open(); kUsage: the directory belongs
///         to a batch that is not divided
Result<std::vector<BatchJob>> prepare_share(std::vector<BatchEntry> entries, const BatchShare& share,
                                            const BatchOptions& options, const std::vector<std::string>& with,
                                            std::optional<BatchRecord>& record);

/// Writes the plan of the shares and runs no job. Costs are microseconds, estimated from a dry run of each job with layers, and
/// from the files of other jobs; equal jobs are run once. A plan of the same list that exists is kept, unless it is
/// overwritten. progress  number of jobs with a cost errors  as prepare_share(); kInterrupted: `cancel` is set, and nothing is
/// written
Result<SharePlan> plan_by_dry_runs(std::vector<BatchEntry> entries, const BatchShare& share, const BatchOptions& options,
                                   const std::vector<std::string>& with, const std::function<void(std::size_t)>& progress,
                                   const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
