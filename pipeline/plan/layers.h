// pipeline/plan/layers.h: the layers of contours or toolpaths in the order of printing, and their
// section planes.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/heights/heights.h"

namespace lamina::pipeline {

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
