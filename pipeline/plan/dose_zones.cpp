#include "pipeline/plan/dose_zones.h"

#include <algorithm>
#include <cmath>

#include "pipeline/plan/sections.h"
#include "stages/data/mesh.h"
#include "stages/raster/combine.h"

namespace lamina::pipeline {
namespace {

using raster::combine;
using raster::SetOperation;
using BleedUm = std::array<double, 2>;

EdgeMove edge_move(const PixelGrid& grid, const BleedUm& um) {
  return {dose::reach_of(grid, std::llround(std::abs(um[0]) * 1000), std::llround(std::abs(um[1]) * 1000)),
          um[0] < 0 || um[1] < 0};
}

Bleed bleed_of(const PixelGrid& grid, const BleedUm& outside, const BleedUm& holes) {
  return {edge_move(grid, outside), edge_move(grid, holes)};
}

void move_edge(const RunsView& image, const dose::Reach& reach, bool grows, Runs& result) {
  grows ? dose::dilate(image, reach, result) : dose::erode(image, reach, result);
}

void copy(const RunsView& image, Runs& result) {
  result.columns = image.columns;
  result.row_offset.assign(image.row_offset.begin(), image.row_offset.end());
  result.change.assign(image.change.begin(), image.change.end());
}

dose::Percent percent_of(const Saturation& saturation) {
  return saturation.formula.empty() ? dose::Percent(saturation.percent) : dose::Percent::of(saturation.formula);
}

}  // namespace

dose::Wish wish_of(const Saturation& saturation, const std::optional<Saturation>& core) {
  dose::Wish wish{percent_of(saturation), {}};
  if (core) wish.core_percent = percent_of(*core);
  return wish;
}

std::uint64_t BleedWork::bytes() const {
  std::uint64_t total = bytes_held(holes.parent);
  for (const Runs* runs : {&moved, &second, &third, &fourth}) total += bytes_held(runs->row_offset) + bytes_held(runs->change);
  return total;
}

void move_edges(const RunsView& image, const Bleed& bleed, BleedWork& work, Runs& result) {
  if (bleed.outside == bleed.holes) return move_edge(image, bleed.outside.reach, bleed.outside.grows, result);
  Runs &filled = work.second, &holes = work.third, &moved = work.fourth;
  dose::fill_holes(image, work.holes, filled);
  combine(filled, image, SetOperation::kDifference, holes);
  // What is set grows into a hole where the hole shrinks.
  if (bleed.holes.any()) {
    move_edge(holes, bleed.holes.reach, !bleed.holes.grows, moved);
    std::swap(holes, moved);
  }
  if (bleed.outside.any()) {
    move_edge(filled, bleed.outside.reach, bleed.outside.grows, moved);
    std::swap(filled, moved);
  }
  combine(filled, holes, SetOperation::kDifference, result);
}

DoseZones::DoseZones(const Job& job, const PixelGrid& grid) {
  const DoseRequest& dose = job.dose;
  const auto zone_of = [&](const PartRequest* part) {
    const bool own = part != nullptr && part->bleed_um;
    const BleedUm outside = own ? *part->bleed_um : dose.bleed_um;
    BleedUm holes = own ? outside : dose.hole_bleed_um.value_or(outside);
    if (part != nullptr && part->hole_bleed_um) holes = *part->hole_bleed_um;
    Zone zone{bleed_of(grid, outside, holes), {}, {}, {}};
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const double first = dose.first_bleed_um ? (*dose.first_bleed_um)[axis] : 0;
      zone.grows_nm[axis] = std::max<std::int64_t>(0, std::llround(-1000 * std::min(outside[axis], first)));
    }
    zone.first_bleed = dose.first_bleed_um ? bleed_of(grid, *dose.first_bleed_um, *dose.first_bleed_um) : zone.bleed;
    if (part != nullptr && part->saturation_percent)
      zone.wish = wish_of(*part->saturation_percent, part->core_saturation_percent);
    return zone;
  };
  if (dose.first_bleed_um) first_layers_ = dose.first_layers;
  zones_.push_back(zone_of(nullptr));
  for (const PartRequest& part : job.parts) {
    Zone zone = zone_of(&part);
    const auto found = std::ranges::find(zones_, zone);
    of_part_.push_back(static_cast<std::uint32_t>(found - zones_.begin()));
    if (found == zones_.end()) zones_.push_back(std::move(zone));
  }
}

bool DoseZones::bleeds() const {
  return std::ranges::any_of(
      zones_, [&](const Zone& zone) { return zone.bleed.any() || (first_layers_ > 0 && zone.first_bleed.any()); });
}

bool DoseZones::grows() const {
  return std::ranges::any_of(
      zones_, [&](const Zone& zone) { return zone.bleed.grows() || (first_layers_ > 0 && zone.first_bleed.grows()); });
}

std::uint32_t DoseZones::most_rows() const {
  std::size_t most = 0;
  for (const Zone& zone : zones_) {
    for (const Bleed* bleed : {&zone.bleed, &zone.first_bleed})
      most = std::max({most, bleed->outside.reach.half_width.size(), bleed->holes.reach.half_width.size()});
  }
  return static_cast<std::uint32_t>(most);
}

std::vector<std::optional<dose::Wish>> DoseZones::wishes() const {
  std::vector<std::optional<dose::Wish>> wishes;
  for (std::size_t zone = 1; zone < zones_.size(); ++zone) wishes.push_back(zones_[zone].wish);
  return wishes;
}

void DoseZones::remove_bleed(const Layer& layer, Runs& image, std::span<Runs> zone, BleedWork& work) const {
  if (!several()) {
    const Bleed& bleed = this->bleed(0, layer);
    if (!bleed.any()) return;
    move_edges(image, bleed, work, work.moved);
    return std::swap(image, work.moved);
  }
  // First all that stays within the layer: what is beside another part is no edge. Then what grows out of it.
  Runs whole;
  copy(image, whole);
  const auto lay = [&](Runs& own) {
    combine(image, own, SetOperation::kUnion, work.second);
    std::swap(image, work.second);
  };
  image.change.clear();
  std::ranges::fill(image.row_offset, 0);
  std::vector<Runs> grown(zone.size());
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    const Bleed& bleed = this->bleed(z, layer);
    if (bleed.grows()) {
      move_edges(zone[z], bleed, work, work.moved);
      combine(work.moved, whole, SetOperation::kDifference, grown[z]);
    }
    if (bleed.any()) {
      move_edges(whole, bleed, work, work.moved);
      combine(work.moved, zone[z], SetOperation::kIntersection, work.second);
      std::swap(zone[z], work.second);
    }
    lay(zone[z]);
  }
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    if (grown[z].change.empty()) continue;
    combine(grown[z], image, SetOperation::kDifference, work.moved);
    combine(zone[z], work.moved, SetOperation::kUnion, work.second);
    std::swap(zone[z], work.second);
    lay(zone[z]);
  }
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
