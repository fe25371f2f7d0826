// pipeline/plan/heights.h: the layers that a job decides on.
#pragma once

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// The index of a scene's surface.
heights::SurfaceIndex index_scene(const Scene& scene, const heights::Options& options);

/// The one table of all parts on the bed, and what can be said for it. Uniform layers cost nothing; other ways look at
/// every facet once.
/// errors  of heights_options and heights::plan_heights
Result<heights::Plan> decide_heights(const Job& job, const Scene& scene);

}  // namespace lamina::pipeline
