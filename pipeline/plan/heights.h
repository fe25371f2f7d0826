// pipeline/plan/heights.h: the layers that a job asks for.
#pragma once

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// [heights] of a job as the stage takes it, checked. errors  kUsage, one line that begins with the key
Result<heights::Options> heights_options(const Job& job);

/// The index of a scene's surface.
heights::SurfaceIndex index_scene(const Scene& scene, const heights::Options& options);

/// The one table of all parts on the bed. Uniform layers cost nothing; other ways look at every facet once.
/// errors  of heights_options and heights::plan_heights
Result<heights::LayerTable> layer_table(const Job& job, const Scene& scene);

/// What a person is told of [heights]: "of 0.05 mm", "of 0.05..0.3 mm, optimal, steps up to 0.1 mm".
std::string heights_text(const Job& job);

/// The word of a way, as in a job file.
std::string mode_name(heights::Mode mode);

}  // namespace lamina::pipeline
