// pipeline/pores/gradient.h: the job of segmented lines whose pores change from the bottom to the top as wished.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "pipeline/pores/design.h"
#include "stages/segment/design/gradient.h"

namespace lamina::pipeline {

using segment::GradientJob;
using segment::GradientStep;

/// Designs each step as design_job() does, with what the runs of the steps below told of the slots, writes one job with a range
/// of heights for each, plans a block as high as all of them with it, and looks at one period in the middle of each region of
/// that one file.
/// request  its wish counts for nothing
/// steps    of segment::steps_of(), in whole layers of the machine's calibration
/// returns  the nearest of steps that cannot be met
/// errors   those of design_job() and run_forward()
/// cost     of design_job() for each step, and of a forward run for each
Result<GradientJob> design_gradient(const DesignRequest& request, const std::vector<segment::WishStep>& steps,
                                    const std::function<bool(double)>& tell);

}  // namespace lamina::pipeline
