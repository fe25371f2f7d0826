#include "stages/checks/lost_features_tally.h"

#include <fmt/format.h>

#include "stages/data/units.h"

namespace lamina::checks {

void LostFeaturesTally::add(const Layer& layer, const LostFeatures& lost) {
  if (lost.area_mm2 <= 0) return;
  if (layers_ == 0) {
    first_ = layer;
    at_ = lost.at;
  }
  ++layers_;
  last_ = layer.index;
  area_mm2_ += lost.area_mm2;
}

void LostFeaturesTally::warn(std::vector<Warning>& warnings) const {
  if (layers_ == 0) return;
  warnings.push_back(
      {"thin-walls",
       fmt::format("features that are too thin for a bead are left out: {:.2f} mm2 in {} of the layers {} to {}, the "
                   "first at {:.1f}, {:.1f}, {:.2f} mm; give narrower beads (--bead) or thicker walls",
                   area_mm2_, layers_, first_.index, last_, mm(at_.x), mm(at_.y), mm(first_.plane()))});
}

}  // namespace lamina::checks
