// pipeline/report/contour_observers.h: what a sliced job counts, layer by layer, for its summary.
#pragma once

#include "pipeline/plan/plan.h"
#include "pipeline/report/observer.h"
#include "stages/slice/slice.h"

namespace lamina::pipeline {

/// In the order of their lines. The plan must outlive them.
void observe_contours(const Plan& plan, Observers<slice::SectionReport>& observers);

}  // namespace lamina::pipeline
