// pipeline/run/run.h: runs a job from its parts to its files.
//
//      Job ──> Resolved ──> Plan ──> Maker ──> flow of its layers through named steps ──> files, Summary
#pragma once

#include <atomic>

#include "pipeline/job/job.h"
#include "pipeline/plan/progress.h"
#include "pipeline/report/summary.h"
#include "stages/data/choices.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct Resolved;  // pipeline/plan/plan.h

/// Runs a job and writes job.output. A dry run ends before the first layer with the summary's estimates;
/// with a printer it makes the layers, reports their time, and writes nothing.
/// job     checked (check_job)
/// cancel  read between layers: once set, no new layer starts, the layers in flight finish and are kept for --resume, and
///         the error is kInterrupted
/// errors  of resolve and make_plan; kUsage: existing output must not be replaced; kOutput; kVerification if the engine
///         is kBoth and a pixel differs, or a strict job has warnings; kInput: a whole job comes out empty; the lowest failing
///         layer decides
Result<Summary> run(const Job& job, Product product, const ProgressCallback& progress, const std::atomic<bool>& cancel);
/// The same of a job whose machine is found already. errors  those of run() but of resolve
Result<Summary> run(Resolved resolved, const ProgressCallback& progress, const std::atomic<bool>& cancel);

}  // namespace lamina::pipeline
