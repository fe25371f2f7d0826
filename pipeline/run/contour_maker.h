// pipeline/run/contour_maker.h: makes the layers of a sliced job: contours and their filling.
#pragma once

#include <memory>

#include "pipeline/plan/plan.h"
#include "pipeline/run/job_checks.h"
#include "pipeline/run/maker.h"

namespace lamina::pipeline {

std::unique_ptr<Maker> make_contour_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits);

}  // namespace lamina::pipeline
