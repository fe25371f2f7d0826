// pipeline/run/path_makers.h: makes the layers of sliced and of extrusion jobs: contours, and walls and fillings as moves.
#pragma once

#include <memory>

#include "pipeline/plan/plan.h"
#include "pipeline/run/job_checks.h"
#include "pipeline/run/maker.h"

namespace lamina::pipeline {

std::unique_ptr<Maker> make_contour_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits);
std::unique_ptr<Maker> make_move_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits);

}  // namespace lamina::pipeline
