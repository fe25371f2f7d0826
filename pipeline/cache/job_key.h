// pipeline/cache/job_key.h: the key of a job in a cache: everything that decides its files and its summary.
#pragma once

#include <optional>
#include <string>

#include "pipeline/cache/input_digests.h"
#include "pipeline/plan/plan.h"
#include "stages/support/hash/hash.h"

namespace lamina::pipeline {

struct JobKey128 {
  std::optional<Hash128> key;  // absent: the job is not cached
  std::string reason;          // then
};

/// The hash of this build of lamina, the resolved job without names and paths, the texts of its machine and material, and the
/// bytes of its parts. Names of parts and of the output are in the key of products whose files contain them: contours and
/// toolpaths; a title is in the key of images.
/// Not cached are dry runs, shards, timed, inspected and quoted jobs, comparisons of engines, parts that are folders of images
/// or made by another program, and toolpaths that go to a device or a pipe.
JobKey128 job_key(const Resolved& resolved, InputDigests& inputs);

}  // namespace lamina::pipeline
