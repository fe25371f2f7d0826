// stages/calibration/scan/locate.h: the position of a layer in a photograph of it, at any rotation.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "stages/calibration/scan/sheet_fit.h"

namespace lamina::calibration {

/// The layer in cells as large as pixels of the photograph: the share of each that is set.
struct LayerCells {
  cv::Mat share;             // CV_32F
  double left = 0, top = 0;  // mm
  double side = 0;           // mm
  Spot middle(int x, int y) const { return {left + (x + 0.5) * side, top + (y + 0.5) * side}; }
};

/// An image in the cells of the layer, CV_32F. outside  the value where the image does not reach
cv::Mat in_cells(const cv::Mat& image, const LayerCells& layer, const View& view, double outside);

struct LayerPosition {
  View view;
  double likeness = -1;           // correlation of layer and photograph in this view, 1 at most
  double rotation_deg = 0;        // of the layer in the photograph, clockwise, from -180 to 180
  std::vector<double> also_deg;   // rotations at which the layer fits as well: it is symmetric
  double mirrored_likeness = -1;  // of the mirrored layer, in its own best view
};

/// Searches all rotations and some scales by correlation on small copies, then moves edges onto edges with perspective. Of
/// rotations that fit as well the smallest is taken.
/// light  of the photograph, CV_32F; its pixels are cells of the layer within 5 %
/// cost   three seconds for a million pixels
LayerPosition locate_layer(const cv::Mat& light, const LayerCells& layer);

}  // namespace lamina::calibration
