// pipeline/nest/plate.h: a build as a job, and what it takes: layers, time, powder, binder and money, copy by copy.
#pragma once

#include <atomic>
#include <cstdint>
#include <optional>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/nest/nest.h"
#include "pipeline/plan/progress.h"
#include "stages/data/choices.h"
#include "stages/data/machine.h"
#include "stages/data/status.h"

namespace lamina::pipeline {

struct Resolved;  // pipeline/plan/plan.h

/// The space of a job's machine, or of its bed; quarter turns.
NestSpace nest_space(const Resolved& resolved);

/// Gives each copy of a job's parts a position of its own, by their outlines.
/// errors  of nest_orders; kUsage: they need several builds, or a part fits none
Status nest_job(Product product, Job& job);

/// The job of a build. options  its settings, and those of its parts
Job plate_of(const NestBuild& build, const std::vector<OrderRow>& rows, const Job& options);

/// Sets build.use of a powder printer: at most 64 layers, spread evenly, are made and programmed; each stands for those next to
/// it. Copies share a layer by the areas of their sections, so equal copies pay the same, but for a hundredth each of hours,
/// binder and powder.
///
/// errors  of make_plan, and of the layers that are made
/// cost    that of the layers that are made
Status quote_build(const Job& plate, Product product, const NestPlan& plan, NestBuild& build);

/// The same for all builds. progress  before each. errors  kInterrupted too
Status quote_builds(Product product, const std::vector<OrderRow>& rows, const Job& options, const ProgressCallback& progress,
                    const std::atomic<bool>& cancel, NestPlan& plan);

}  // namespace lamina::pipeline
