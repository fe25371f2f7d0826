// pipeline/plan/layers.h: the layers of a file of contours or toolpaths in the order in which they are made, and the
// planes that they are cut at.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/job/job.h"
#include "pipeline/plan/scene.h"
#include "stages/data/layer.h"
#include "stages/data/status.h"
#include "stages/heights/table.h"

namespace lamina::pipeline {

inline constexpr std::uint32_t kEveryPart = UINT32_MAX;

struct ScheduledLayer {
  Layer layer;              // its index is its place in the file; tops never go down
  std::uint32_t part;       // whose it is, kEveryPart if all parts have the same layers
  std::uint32_t number;     // which layer it is of those of its part, from 0: fillings turn by it
  std::uint32_t low, high;  // into planes; the same one unless steps have to stay inside or outside of the surface

  /// As a filling sees it.
  Layer own() const { return {number, layer.bottom, layer.thickness, layer.reason}; }
};

struct LayerSchedule {
  std::vector<ScheduledLayer> layers;
  std::vector<Nm> planes;  // nm above the bed, strictly increasing
};

/// With job.heights.per_part every part has the best layers of its own between common slabs (stages/heights/per_part.h);
/// they are made in the order of their tops, so that the nozzle never has to go below what is printed by more than a
/// slab. Else all parts have those of the table.
/// errors  of heights_options and heights::plan_per_part
/// cost    28 bytes a layer and 4 bytes a plane
Result<LayerSchedule> schedule_layers(const Job& job, const Scene& scene, const heights::LayerTable& table);

}  // namespace lamina::pipeline
