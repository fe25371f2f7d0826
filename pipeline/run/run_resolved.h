// pipeline/run/run_resolved.h: run() of a job whose machine is found already.
#pragma once

#include "pipeline/plan/plan.h"
#include "pipeline/run/run.h"

namespace lamina::pipeline {

/// As run() of the job. errors  those of run() but of resolve
Result<Summary> run(Resolved resolved, const ProgressCallback& progress, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
