// pipeline/run/move_maker.h: the layers of an extrusion job: walls and fillings as moves, thick and thin stretches.
#pragma once

#include <memory>

#include "pipeline/plan/plan.h"
#include "pipeline/run/maker.h"

namespace lamina::pipeline {

/// What is known of the moves before any is laid: the printer and the pores.
void tell_moves(const Plan& plan, Summary& summary);

std::unique_ptr<Maker> make_move_maker(const Plan& plan, const FlowLimits& limits);

}  // namespace lamina::pipeline
