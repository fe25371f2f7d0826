#include "pipeline/plan/dose_zones.h"

#include <algorithm>
#include <cmath>

#include "pipeline/plan/sections.h"
#include "stages/data/mesh.h"

namespace lamina::pipeline {
DoseZones::DoseZones(const Job& job, const PixelGrid& grid) : bleeds_(job.dose.first_bleed_um ? job.dose.first_layers : 0) {
  const DoseRequest& dose = job.dose;
  const auto zone_of = [&](const PartRequest* part) {
    const bool own = part != nullptr && part->bleed_um;
    const dose::BleedUm outside = own ? *part->bleed_um : dose.bleed_um;
    dose::BleedUm holes = own ? outside : dose.hole_bleed_um.value_or(outside);
    if (part != nullptr && part->hole_bleed_um) holes = *part->hole_bleed_um;
    Zone zone;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double first = dose.first_bleed_um ? (*dose.first_bleed_um)[axis] : 0;
      zone.grows_nm[axis] = std::max<std::int64_t>(0, std::llround(-1000 * std::min(outside[axis], first)));
    }
    zone.bleed.above = dose::bleed_of(grid, outside, holes);
    zone.bleed.first =
        dose.first_bleed_um ? dose::bleed_of(grid, *dose.first_bleed_um, *dose.first_bleed_um) : zone.bleed.above;
    if (part != nullptr && part->saturation_percent)
      zone.wish = dose::Wish{*part->saturation_percent, part->core_saturation_percent};
    return zone;
  };
  zones_.push_back(zone_of(nullptr));
  for (const PartRequest& part : job.parts) {
    Zone zone = zone_of(&part);
    const auto found = std::ranges::find(zones_, zone);
    of_part_.push_back(static_cast<std::uint32_t>(found - zones_.begin()));
    if (found == zones_.end()) zones_.push_back(std::move(zone));
  }
  for (const Zone& zone : zones_) bleeds_.add_zone(zone.bleed);
}

std::vector<std::optional<dose::Wish>> DoseZones::wishes() const {
  std::vector<std::optional<dose::Wish>> wishes;
  for (std::size_t zone = 1; zone < zones_.size(); ++zone) wishes.push_back(zones_[zone].wish);
  return wishes;
}

std::vector<dose::ZoneBox> zone_boxes(const Scene& scene, const DoseZones& zones, const PixelGrid& grid) {
  std::vector<dose::ZoneBox> boxes;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const std::uint32_t zone = zones.of_part(scene.part_of_instance[i]);
    const auto [x, y] = zones.grows_nm(zone);
    const Box box = box_of(scene, scene.instances[i]);
    boxes.push_back(
        {zone, {box.lo.x - x, box.lo.y - y, box.lo.z}, {box.hi.x + x, box.hi.y + y, box.hi.z}, {box.lo.x, box.lo.y, box.lo.z}});
  }
  for (const PlacedImages& of : scene.images) {  // anywhere on the bed
    const std::int64_t top = of.bottom + std::int64_t{of.thickness} * of.images->layers();
    boxes.push_back({zones.of_part(of.part), {0, 0, of.bottom}, {grid.x.length, grid.y.length, top}});
  }
  return boxes;
}

}  // namespace lamina::pipeline
