// stages/checks/overhang_tally.h: the overhangs of all layers, and their warning.
//
// code  overhangs  areas of layers hang over air
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/layer.h"
#include "stages/data/overhang.h"
#include "stages/data/status.h"

namespace lamina::checks {

/// Of layers in the order of their tops.
class OverhangTally {
 public:
  /// Connected areas of layers that rest on each other and overlap, as boxes.
  struct Location {
    double area_mm2 = 0;
    double x_mm = 0, y_mm = 0, z_mm = 0;  // of the largest area; z of its layer's plane
  };

  void add(const Layer& layer, const LayerOverhang& overhang);

  double area_mm2() const { return area_mm2_; }
  std::uint32_t layers() const { return layers_; }
  std::uint32_t first_layer() const { return first_.index; }
  std::uint32_t last_layer() const { return last_; }
  /// Whether there is enough to warn of: 0.01 mm2.
  bool any() const { return area_mm2_ >= 0.01; }
  /// At most kMaxLocations, largest first.
  std::vector<Location> largest() const;
  void warn(double angle_deg, std::vector<Warning>& warnings) const;

  static constexpr std::size_t kMaxLocations = 3;

 private:
  struct OpenLocation {
    Location location;
    double largest_mm2 = 0;
    Point2 lo{}, hi{};     // of the box in the last layer
    std::int64_t top = 0;  // nm, of the last layer
  };
  void close(const Location& location);

  double area_mm2_ = 0;
  std::uint32_t layers_ = 0, last_ = 0;
  Layer first_{};
  std::vector<OpenLocation> open_;
  std::vector<Location> closed_;  // the largest
};

}  // namespace lamina::checks
