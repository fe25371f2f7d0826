// pipeline/plan/layers.h: decides the layers of a job, and their order.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/heights/greedy.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

/// The index of a scene's surface; angles are those of the parts before --shrink.
heights::SurfaceIndex index_scene(const Job& job, const Scene& scene, const heights::Options& options);

/// Whether layers that cover a part are deposited regardless of the position of their middle.
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

inline constexpr std::uint32_t kEveryPart = UINT32_MAX;

struct ScheduledLayer {
  Layer layer;              // its index is its place in the file; tops never decrease
  std::uint32_t part;       // owner, kEveryPart if all parts share the layers
  std::uint32_t number;     // index among the layers of its part, from 0: it sets the filling's angle
  std::uint32_t low, high;  // into planes; equal unless steps must stay inside or outside of the surface

  /// The layer with its number within the part, for the filling.
  Layer own() const { return {number, layer.bottom, layer.thickness, layer.reason}; }
};

struct LayerSchedule {
  std::vector<ScheduledLayer> layers;
  std::vector<Nm> planes;  // nm above the bed, strictly increasing
};

/// With job.heights.per_part every part has its own optimal layers between common slabs (stages/heights/heights.h),
/// printed in the order of their tops: the nozzle never moves more than one slab below printed material. Otherwise all
/// parts share the layers of the table. Planes are those of plane_of(), each part with its own top.
/// errors  of heights_options and heights::plan_per_part
/// cost    28 bytes per layer and 4 bytes per plane
Result<LayerSchedule> schedule_layers(const Job& job, const Scene& scene, const heights::LayerTable& table);

/// Removes layers at the tops of parts that end below their cutting planes: nothing would be deposited in them. That is
/// the middle, or with kInside the top, and with kOutside the bottom. A part keeps its first layer.
/// returns  how many
std::uint32_t drop_empty_top(const Scene& scene, Containment containment, LayerSchedule& schedule);

}  // namespace lamina::pipeline
