#include "pipeline/plan/heights.h"

#include "pipeline/job/decisions.h"
#include "pipeline/job/heights.h"

namespace lamina::pipeline {

heights::SurfaceIndex index_scene(const Job& job, const Scene& scene, const heights::Options& options) {
  std::vector<heights::Stretch> stretch(scene.meshes.size(), {1, 1, 1});
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    stretch[scene.instances[i].mesh] = job.parts[scene.part_of_instance[i]].shrink;
  }
  return heights::index_surface(scene.meshes, scene.instances, scene.part_of_instance,
                                static_cast<std::uint32_t>(scene.parts.size()), options.surface, stretch);
}

Result<heights::Plan> decide_heights(const Job& job, const Scene& scene) {
  count(Decision::kHeights);
  const Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  if (options->mode != heights::Mode::kUniform) return heights::plan_heights(index_scene(job, scene, *options), *options);
  heights::Plan plan;
  plan.table = heights::LayerTable::uniform(scene.height, options->set.least());
  return plan;
}

}  // namespace lamina::pipeline
