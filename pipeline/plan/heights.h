// pipeline/plan/heights.h: decides the layers of a job.
#pragma once

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// The index of a scene's surface; angles are those of the parts before --shrink.
heights::SurfaceIndex index_scene(const Job& job, const Scene& scene, const heights::Options& options);

/// The layer table shared by all parts on the bed, with its reasons. Uniform layers cost nothing; other modes read every
/// facet once.
/// errors  of heights_options and heights::plan_heights
Result<heights::Plan> decide_heights(const Job& job, const Scene& scene);

}  // namespace lamina::pipeline
