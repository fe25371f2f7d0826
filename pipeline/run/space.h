// pipeline/run/space.h: what a job of images is going to write, and whether its file system has space for it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/plan/plan.h"
#include "pipeline/report/summary.h"
#include "stages/data/mesh.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct SpaceNeed {
  std::uint64_t bytes = 0;    // estimated from some layers that were made and encoded; 0: of none
  std::uint32_t sampled = 0;  // layers
};

/// Makes some layers of the plan, spread over its range, and drops what they come to. Layers that fail count as empty: the job
/// reports them.
/// cost  of three layers at most, of one in 64 in jobs that write
SpaceNeed estimate_space(const Plan& plan);

/// Bytes that the plan's files cannot exceed by much: planes of bits, programs of full sweeps. cost  O(1)
std::uint64_t space_bound(const Plan& plan);

/// The folder at or above `output` that is there, and the bytes that its file system can take.
struct FreeSpace {
  std::string folder;
  std::uint64_t bytes = 0;
};
/// Nothing if the system does not say.
std::optional<FreeSpace> free_space(const std::string& output);

/// Refuses a job of which not even half of the estimate fits, and warns of one that may not fit.
/// freed   bytes of files of the same job that are replaced or kept
/// only_warn  of a dry run
/// errors  kOutput
Status check_space(const SpaceNeed& need, const FreeSpace& space, std::uint64_t freed, bool only_warn,
                   std::vector<Warning>& warnings);

/// Before a job's files are begun: estimates what may not fit, and the files of dry runs, for their summary. errors  kOutput
Status check_space(const Plan& plan, Summary& summary);

}  // namespace lamina::pipeline
