#include "pipeline/run/travel_region.h"

namespace lamina::pipeline {
namespace {

bool is_used(const Plan& plan) {
  const Extruder& machine = plan.moves->profile.machine;
  return machine.format == "gcode" && machine.retraction.inside && machine.retraction.length_mm > 0;
}

}  // namespace

TravelRegion::TravelRegion(const Plan& plan, const Sections::Work& work) : plan_(plan) {
  if (is_used(plan)) grid_.emplace(work.contours.contours);
}

formats::LayerSurroundings TravelRegion::surroundings(
    const std::optional<formats::LayerSurroundings::Progress>& progress) const {
  const FillSettings& fill = plan_.job.fill.all;
  const double width_mm = fill.wall_width_mm > 0 ? fill.wall_width_mm : fill.width_mm;
  formats::LayerSurroundings around;
  around.region = grid_ ? &*grid_ : nullptr;
  around.inset = static_cast<Nm>(nm_of(width_mm / 2));
  around.progress = progress;
  return around;
}

std::uint64_t TravelRegion::bytes_bound(const Plan& plan, const Sections::Work& work) {
  if (!is_used(plan)) return 0;
  return travel::EdgeGrid::kBytesOfGrid + travel::EdgeGrid::kBytesOfPoint * work.contours.contours.point.size();
}

}  // namespace lamina::pipeline
