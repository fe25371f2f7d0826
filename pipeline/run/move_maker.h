// pipeline/run/move_maker.h: makes the layers of an extrusion job: walls and fillings as moves, with thick and thin stretches.
#pragma once

#include <memory>

#include "pipeline/plan/plan.h"
#include "pipeline/run/job_checks.h"
#include "pipeline/run/maker.h"

namespace lamina::pipeline {

std::unique_ptr<Maker> make_move_maker(const Plan& plan, JobChecks& checks, const FlowLimits& limits);

}  // namespace lamina::pipeline
