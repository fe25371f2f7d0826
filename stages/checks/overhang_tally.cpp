#include "stages/checks/overhang_tally.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/support/text/number_text.h"

namespace lamina::checks {
namespace {

bool is_larger(const OverhangTally::Location& a, const OverhangTally::Location& b) { return a.area_mm2 > b.area_mm2; }

void keep_largest(std::vector<OverhangTally::Location>& locations) {
  std::ranges::stable_sort(locations, is_larger);
  if (locations.size() > OverhangTally::kMaxLocations) locations.resize(OverhangTally::kMaxLocations);
}

}  // namespace

void OverhangTally::close(const Location& location) {
  closed_.push_back(location);
  keep_largest(closed_);
}

void OverhangTally::add(const Layer& layer, const LayerOverhang& overhang) {
  std::erase_if(open_, [&](const OpenLocation& open) {
    if (open.top >= layer.bottom) return false;
    close(open.location);
    return true;
  });
  if (overhang.area_mm2 <= 0) return;
  area_mm2_ += overhang.area_mm2;
  if (layers_++ == 0) first_ = layer;
  last_ = layer.index;
  const std::int64_t top = std::int64_t{layer.bottom} + layer.thickness;
  for (const OverhangSpot& spot : overhang.spots) {
    const auto meets = [&](const OpenLocation& open) {
      return open.top < top && spot.lo.x <= open.hi.x && open.lo.x <= spot.hi.x && spot.lo.y <= open.hi.y &&
             open.lo.y <= spot.hi.y;
    };
    auto found = std::ranges::find_if(open_, meets);
    if (found == open_.end()) found = open_.insert(open_.end(), OpenLocation());
    found->location.area_mm2 += spot.area_mm2;
    if (spot.area_mm2 > found->largest_mm2) {
      found->largest_mm2 = spot.area_mm2;
      found->location.x_mm = mm(spot.at.x), found->location.y_mm = mm(spot.at.y), found->location.z_mm = mm(layer.plane());
    }
    found->lo = spot.lo, found->hi = spot.hi, found->top = top;
  }
}

std::vector<OverhangTally::Location> OverhangTally::largest() const {
  std::vector<Location> all = closed_;
  for (const OpenLocation& open : open_) all.push_back(open.location);
  keep_largest(all);
  return all;
}

void OverhangTally::warn(double angle_deg, std::vector<Warning>& warnings) const {
  if (!any()) return;
  std::string locations;
  for (const Location& one : largest()) {
    locations += fmt::format("{}{:.2f} mm2 near ({:.2f}, {:.2f}, {:.2f}) mm", locations.empty() ? "" : ", ", one.area_mm2,
                             one.x_mm, one.y_mm, one.z_mm);
  }
  const std::string in = layers_ == 1 ? fmt::format("layer {}", first_.index)
                                      : fmt::format("{} layers from {} to {}", layers_, first_.index, last_);
  warnings.push_back({"overhangs",
                      fmt::format("{:.2f} mm2 in {} hang over air, flatter than {} degrees: {}; turn the parts, add supports "
                                  "to them, or give another --support-angle",
                                  area_mm2_, in, number_text(angle_deg), locations),
                      {},
                      first_.index,
                      mm(first_.plane())});
}

}  // namespace lamina::checks
