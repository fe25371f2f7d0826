#include "stages/dose/edges/bleed.h"

#include <algorithm>
#include <cmath>

#include "stages/dose/edges/dilate.h"
#include "stages/geometry/combine.h"

namespace lamina::dose {
namespace {

EdgeMove edge_move(const PixelGrid& grid, const BleedUm& um) {
  return {reach_of(grid, std::llround(std::abs(um[0]) * 1000), std::llround(std::abs(um[1]) * 1000)), um[0] < 0 || um[1] < 0};
}

void move_edge(const RunsView& image, const Reach& reach, bool grows, Runs& result) {
  grows ? dilate(image, reach, result) : erode(image, reach, result);
}

void copy(const RunsView& image, Runs& result) {
  result.columns = image.columns;
  result.row_offset.assign(image.row_offset.begin(), image.row_offset.end());
  result.change.assign(image.change.begin(), image.change.end());
}

/// A layer's image with moved edges. What stands in a hole has the edges of that hole.
void move_edges(const RunsView& image, const Bleed& bleed, BleedWork& work, Runs& result) {
  if (bleed.outside == bleed.holes) return move_edge(image, bleed.outside.reach, bleed.outside.grows, result);
  Runs &filled = work.second, &holes = work.third, &moved = work.fourth;
  fill_holes(image, work.holes, filled);
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

}  // namespace

Bleed bleed_of(const PixelGrid& grid, const BleedUm& outside, const BleedUm& holes) {
  return {edge_move(grid, outside), edge_move(grid, holes)};
}

std::uint64_t BleedWork::bytes() const {
  std::uint64_t total = bytes_held(holes.parent);
  for (const Runs* runs : {&moved, &second, &third, &fourth}) total += bytes_held(runs->row_offset) + bytes_held(runs->change);
  return total;
}

bool Bleeds::any() const {
  return std::ranges::any_of(
      zones_, [&](const ZoneBleed& zone) { return zone.above.any() || (first_layers_ > 0 && zone.first.any()); });
}

bool Bleeds::grows() const {
  return std::ranges::any_of(
      zones_, [&](const ZoneBleed& zone) { return zone.above.grows() || (first_layers_ > 0 && zone.first.grows()); });
}

std::uint32_t Bleeds::max_rows() const {
  std::size_t maximum = 0;
  for (const ZoneBleed& zone : zones_) {
    for (const Bleed* bleed : {&zone.above, &zone.first})
      maximum = std::max({maximum, bleed->outside.reach.half_width.size(), bleed->holes.reach.half_width.size()});
  }
  return static_cast<std::uint32_t>(maximum);
}

void Bleeds::remove(const Layer& layer, Runs& image, std::span<Runs> zone, BleedWork& work) const {
  if (zones_.size() == 1) {
    const Bleed& bleed = of(0, layer);
    if (!bleed.any()) return;
    move_edges(image, bleed, work, work.moved);
    return std::swap(image, work.moved);
  }
  // First all that stays within the layer: a border with another part is no edge. Then what grows out of it.
  Runs whole;
  copy(image, whole);
  const auto deposit = [&](Runs& own) {
    combine(image, own, SetOperation::kUnion, work.second);
    std::swap(image, work.second);
  };
  image.change.clear();
  std::ranges::fill(image.row_offset, 0);
  std::vector<Runs> grown(zone.size());
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    const Bleed& bleed = of(z, layer);
    if (bleed.grows()) {
      move_edges(zone[z], bleed, work, work.moved);
      combine(work.moved, whole, SetOperation::kDifference, grown[z]);
    }
    if (bleed.any()) {
      move_edges(whole, bleed, work, work.moved);
      combine(work.moved, zone[z], SetOperation::kIntersection, work.second);
      std::swap(zone[z], work.second);
    }
    deposit(zone[z]);
  }
  for (std::uint32_t z = 0; z < zone.size(); ++z) {
    if (grown[z].change.empty()) continue;
    combine(grown[z], image, SetOperation::kDifference, work.moved);
    combine(zone[z], work.moved, SetOperation::kUnion, work.second);
    std::swap(zone[z], work.second);
    deposit(zone[z]);
  }
}

}  // namespace lamina::dose
