// pipeline/plan/heights.h: decides the layers of a job.
#pragma once

#include <memory>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/status.h"
#include "stages/heights/greedy.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// The index of a scene's surface; angles are those of the parts before --shrink.
heights::SurfaceIndex index_scene(const Job& job, const Scene& scene, const heights::Options& options);

/// Whether layers that cover a part are to be laid wherever their middle lies.
bool covers_top(const Job& job);

/// The height at which a layer samples the parts, nm; `top` is that of the highest one.
Nm plane_of(const Job& job, const Layer& layer, std::int64_t top);

/// The layer table shared by all parts on the bed, with its reasons. Uniform layers cost nothing; other modes read every
/// facet once.
/// errors  of heights_options and heights::plan_heights
Result<heights::Plan> decide_heights(const Job& job, const Scene& scene);

/// Whether the modes of a job decide one layer after the other.
bool decides_in_order(const Job& job);

/// Begins to decide the layer table shared by all parts, for a job that decides_in_order(). errors  as above
Result<std::unique_ptr<heights::GreedyLayers>> begin_heights(const Job& job, const Scene& scene, heights::Plan& plan);

}  // namespace lamina::pipeline
