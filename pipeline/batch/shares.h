// pipeline/batch/shares.h: divides a list of jobs among processes that have only a directory in common.
//
// DIR/shares.tsv is the plan that all of them follow. The first process writes it; each of the others reads it and checks that
// it would have planned the same list. Scheduling, retries and lost nodes are left to a scheduler.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "pipeline/batch/job.h"
#include "stages/data/status.h"
#include "stages/support/hash/hash.h"
#include "stages/support/io/file.h"

namespace lamina::pipeline {

/// What the division reads of a job.
struct CostedJob {
  std::uint64_t cost = 1;  // in any unit, 1 to kMaxJobCost; without `load`
  Hash128 part;            // of the path of its first part file; zero without one
  std::uint64_t load = 0;  // of that part: once in each share that has jobs of the part. The largest of its jobs counts
};
inline constexpr std::uint64_t kMaxJobCost = std::uint64_t{1} << 40;

/// Cost from the files alone: (64 KiB + expected memory of the input files) x layers per mm.
/// cost  a system call per new file; `known` has those of earlier calls
class FileCosts {
 public:
  CostedJob of(const Call& call);

 private:
  std::map<Hash128, std::uint64_t, HashOrder> known_;  // bytes by the names of files
};

/// A share of a job, from 1, and what the job costs there: the first one of its part has the cost of loading it.
struct DividedJob {
  std::uint32_t share = 0;
  std::uint64_t cost = 0;
  bool operator==(const DividedJob&) const = default;
};

/// Jobs of one part are cut, in order, into pieces of at most 5 % of a mean share, loading included. The dearest piece goes to
/// the share with the smallest sum, the lower number first. If no job costs more than 5 % of a mean share with its load, no
/// share costs more than 1.05 times the mean.
std::vector<DividedJob> divide_jobs(std::span<const CostedJob> jobs, std::uint32_t shares);

inline constexpr std::string_view kPlannedUnit = "microseconds";  // of costs by dry runs

struct PlannedJob {
  std::uint32_t share = 0;  // from 1
  std::uint64_t cost = 0;
  Hash128 words;       // of its words in the list
  std::string source;  // "jobs.txt:12"
};

/// The plan: docs/reference/formats.md describes the file.
struct SharePlan {
  std::uint32_t shares = 0;
  std::string version;     // of lamina
  std::string with;        // words of --with, as JSON
  std::string unit;        // of the costs: kPlannedUnit or another one
  bool overwrite = false;  // what is where the jobs write is replaced by the share that has not begun them yet
  Hash128 generation;      // repeated by the records of the shares; set by agree_on_plan()
  std::vector<PlannedJob> jobs;

  /// Sums of the costs of all shares.
  std::vector<std::uint64_t> costs() const;
};

SharePlan plan_shares(const std::vector<BatchJob>& jobs, std::span<const CostedJob> costs, std::uint32_t shares,
                      const std::vector<std::string>& with, std::string_view unit);

/// DIR/shares.tsv
std::string plan_path(const std::string& directory);

/// errors  kVerification: the file is damaged or missing
Result<SharePlan> read_plan(const std::string& directory);

/// Locks the plan, there or not, until the file is finished or discarded; waits for another process that has the lock. Makes
/// the directory. errors  kOutput
Result<File> lock_plan(const std::string& directory);

/// The plan in the directory, which is `own` if there was none. A different plan is replaced with `overwrite` only. Its
/// generation depends on the plan that it replaces, so that processes that start together replace a plan once. With `overwrite`
/// a new plan also replaces a batch that is not divided.
/// errors  kUsage: another number of shares, other words of --with, another version, another list (names the first difference),
///         a share of the plan to be replaced is running, the directory belongs to a batch that is not divided;
///         kVerification: the file is damaged; kOutput
Result<SharePlan> agree_on_plan(const std::string& directory, const SharePlan& own, bool overwrite);

/// Checks, with the record of a share open, that its plan was not replaced or merged. Waits for processes that lock the plan:
/// they find the record open, or this finds what they did. returns  its generation. errors  kOutput: it was
Result<Hash128> check_same_plan(const std::string& directory, const SharePlan& plan);

/// Whether a directory belongs to a batch in shares; whether it belongs to one that is not divided.
bool has_shares(const std::string& directory);
bool has_undivided_batch(const std::string& directory);
/// errors  kUsage: the directory belongs to a batch that is not divided, or such a batch is running
Status check_not_undivided(const std::string& directory);

/// Removes the files of the shares, or of an undivided batch, not the output of their jobs.
/// errors  kOutput: one of them is running; kOutput: a file cannot be removed
Status remove_shares(const std::string& directory);
Status remove_undivided_batch(const std::string& directory);
/// As remove_shares(), of shares without a plan. Waits up to 5 s for a share that has started and ends by check_same_plan().
/// The caller has no lock of the plan.
Status remove_merged_shares(const std::string& directory);

}  // namespace lamina::pipeline
