// pipeline/cli/batch_call.h: a command line as a job of a batch.
#pragma once

#include <string>
#include <vector>

#include "pipeline/batch/job.h"

namespace lamina::pipeline {

/// Reads a command line: any command but batch and preview. errors  kUsage: no such command, wrong arguments, a job file
/// that cannot be read
Result<Call> read_call(const std::vector<std::string>& words);

}  // namespace lamina::pipeline
