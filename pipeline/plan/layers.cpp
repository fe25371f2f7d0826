#include "pipeline/plan/layers.h"

#include <algorithm>
#include <tuple>

#include "pipeline/job/decisions.h"
#include "pipeline/job/job.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {
namespace {

std::int64_t top(const ScheduledLayer& scheduled) { return std::int64_t{scheduled.layer.bottom} + scheduled.layer.thickness; }

/// The tops of the parts, nm above the bed.
std::vector<Nm> tops_of(const Scene& scene) {
  std::vector<Nm> tops(scene.parts.size());
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Instance& instance = scene.instances[i];
    Nm& top = tops[scene.part_of_instance[i]];
    top = std::max(top, scene.meshes[instance.mesh].bounds.hi.z + instance.offset.z);
  }
  return tops;
}

Status add_layers_of_parts(const Job& job, const Scene& scene, std::vector<ScheduledLayer>& layers) {
  count(Decision::kHeights);
  const Result<heights::Options> options = heights_options(job);
  if (!options) return options.error();
  const heights::SurfaceIndex index = index_scene(job, scene, *options);
  const Result<heights::PerPartPlan> plan = heights::plan_per_part(index, *options);
  if (!plan) return plan.error();
  for (std::uint32_t part = 0; part < plan->parts.size(); ++part) {
    const heights::LayerTable& table = plan->parts[part].table;
    std::uint32_t number = 0;
    for (std::uint32_t i = 0; i < table.size(); ++i) {
      const ScheduledLayer scheduled{table[i], part, number, 0, 0};
      if (top(scheduled) <= index.parts[part].bottom) continue;  // under a part that does not stand on the bed
      layers.push_back(scheduled);
      ++number;
    }
  }
  std::ranges::stable_sort(layers, {}, [](const ScheduledLayer& s) { return std::tuple(top(s), s.layer.bottom, s.part); });
  for (std::uint32_t i = 0; i < layers.size(); ++i) layers[i].layer.index = i;
  return {};
}

}  // namespace

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
  const double first = job.extrude.raft_layers > 0 ? 0 : job.extrude.first_thickness_mm.value_or(0);
  plan.table = heights::LayerTable::uniform(scene.height, options->set.minimum(),
                                            static_cast<Nm>(nm_of(first)));
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

Result<LayerSchedule> schedule_layers(const Job& job, const Scene& scene, const heights::LayerTable& table) {
  LayerSchedule schedule;
  if (job.heights.per_part) {
    if (Status status = add_layers_of_parts(job, scene, schedule.layers); !status) return status.error();
  } else {
    schedule.layers.reserve(table.size());
    for (std::uint32_t i = 0; i < table.size(); ++i) schedule.layers.push_back({table[i], kEveryPart, i, 0, 0});
  }
  const bool across = job.heights.containment == Containment::kAcross;
  const std::vector<Nm> tops = tops_of(scene);
  const auto middle = [&](const ScheduledLayer& s) {
    return plane_of(job, s.layer, s.part == kEveryPart ? scene.height : tops[s.part]);
  };
  const auto lowest = [&](const ScheduledLayer& s) { return across ? middle(s) : s.layer.lowest_plane(); };
  const auto highest = [&](const ScheduledLayer& s) { return across ? middle(s) : s.layer.highest_plane(); };
  std::vector<Nm>& planes = schedule.planes;
  planes.reserve(schedule.layers.size() * (across ? 1 : 2));
  for (const ScheduledLayer& scheduled : schedule.layers) {
    planes.push_back(lowest(scheduled));
    if (!across) planes.push_back(highest(scheduled));
  }
  std::ranges::sort(planes);
  planes.erase(std::unique(planes.begin(), planes.end()), planes.end());
  const auto position = [&](Nm plane) {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(planes, plane) - planes.begin());
  };
  for (ScheduledLayer& scheduled : schedule.layers) {
    scheduled.low = position(lowest(scheduled));
    scheduled.high = position(highest(scheduled));
  }
  return schedule;
}

std::uint32_t drop_empty_top(const Scene& scene, Containment containment, LayerSchedule& schedule) {
  const auto plane = containment == Containment::kInside ? &ScheduledLayer::high : &ScheduledLayer::low;
  const std::vector<Nm> tops = tops_of(scene);
  const auto dropped = std::erase_if(schedule.layers, [&](const ScheduledLayer& s) {
    return s.number > 0 && schedule.planes[s.*plane] + kPlaneReach >= (s.part == kEveryPart ? scene.height : tops[s.part]);
  });
  for (std::uint32_t i = 0; i < schedule.layers.size(); ++i) schedule.layers[i].layer.index = i;
  return static_cast<std::uint32_t>(dropped);
}

}  // namespace lamina::pipeline
