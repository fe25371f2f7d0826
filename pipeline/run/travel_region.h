// pipeline/run/travel_region.h: where the travels of a layer need no retraction.
#pragma once

#include <cstdint>
#include <optional>

#include "pipeline/plan/plan.h"
#include "pipeline/plan/sections.h"
#include "stages/formats/extrusion_format.h"
#include "stages/geometry/travel/edge_grid.h"

namespace lamina::pipeline {

/// The contours of a layer as a region for travels, if the machine travels inside without a retraction.
class TravelRegion {
 public:
  /// work  of Sections::contours(); must outlive this object
  TravelRegion(const Plan& plan, const Sections::Work& work);
  TravelRegion(const TravelRegion&) = delete;
  TravelRegion& operator=(const TravelRegion&) = delete;
  formats::LayerSurroundings surroundings(const std::optional<formats::LayerSurroundings::Progress>& progress) const;

  /// Upper bound of its memory, bytes.
  static std::uint64_t bytes_bound(const Plan& plan, const Sections::Work& work);

 private:
  const Plan& plan_;
  std::optional<travel::EdgeGrid> grid_;
};

}  // namespace lamina::pipeline
