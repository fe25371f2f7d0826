#include "pipeline/plan/heights.h"

#include "pipeline/job/decisions.h"
#include "pipeline/job/job.h"

namespace lamina::pipeline {

bool covers_top(const Job& job) {
  const bool by_rule = job.heights.mode == heights::Mode::kAngle || job.heights.mode == heights::Mode::kOptimal;
  return job.heights.cover_top && (by_rule || job.heights.per_part);
}

Nm plane_of(const Job& job, const Layer& layer, std::int64_t top) {
  return covers_top(job) ? layer.plane_below(top) : layer.plane();
}

heights::SurfaceIndex index_scene(const Job& job, const Scene& scene, const heights::Options& options) {
  std::vector<heights::ScaleFactors> scale(scene.meshes.size(), {1, 1, 1});
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    scale[scene.instances[i].mesh] = job.parts[scene.part_of_instance[i]].shrink;
  }
  return heights::index_surface(scene.meshes, scene.instances, scene.part_of_instance,
                                static_cast<std::uint32_t>(scene.parts.size()), options.surface, scale);
}

Result<heights::Plan> decide_heights(const Job& job, const Scene& scene) {
  count(Decision::kHeights);
  const Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  if (options->mode != heights::Mode::kUniform) return heights::plan_heights(index_scene(job, scene, *options), *options);
  heights::Plan plan;
  plan.table = heights::LayerTable::uniform(scene.height, options->set.minimum());
  return plan;
}

bool decides_in_order(const Job& job) {
  return job.heights.mode != heights::Mode::kUniform && job.heights.mode != heights::Mode::kOptimal && !job.heights.per_part;
}

Result<std::unique_ptr<heights::GreedyLayers>> begin_heights(const Job& job, const Scene& scene, heights::Plan& plan) {
  count(Decision::kHeights);
  const Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  return heights::begin_heights(index_scene(job, scene, *options), *options, plan);
}

}  // namespace lamina::pipeline
