// pipeline/run/image_maker.h: makes the layers of a powder job: exact images per material, and print programs.
#pragma once

#include <memory>

#include "pipeline/plan/plan.h"
#include "pipeline/run/job_checks.h"
#include "pipeline/run/maker.h"

namespace lamina::pipeline {

std::unique_ptr<Maker> make_image_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits);

}  // namespace lamina::pipeline
