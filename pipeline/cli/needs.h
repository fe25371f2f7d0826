// pipeline/cli/needs.h: options that have no effect unless another one is given.
#pragma once

#include "pipeline/cli/arguments.h"
#include "pipeline/job/job.h"
#include "stages/data/choices.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

/// Refuses options that would do nothing in this job; keys of files are not looked at.
/// errors  kUsage with the option, why, and what to add
Status check_needs(Product product, const Arguments& arguments, const Job& job);

}  // namespace lamina::pipeline
