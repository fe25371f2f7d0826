// stages/checks/lost_features_tally.h: features that are thinner than a bead, of all layers, and their warning.
//
// code  thin-walls  features of the parts get no bead
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/lost_features.h"
#include "stages/data/status.h"

namespace lamina::checks {

class LostFeaturesTally {
 public:
  /// In the order of layers.
  void add(const Layer& layer, const LostFeatures& lost);
  void warn(std::vector<Warning>& warnings) const;

 private:
  double area_mm2_ = 0;
  std::uint32_t layers_ = 0, last_ = 0;
  Layer first_{};
  Point2 at_{};
};

}  // namespace lamina::checks
