// stages/calibration/scan/compare.h: compares a photograph of a printed layer with the layer.
#pragma once

#include <vector>

#include "stages/calibration/scan/locate.h"
#include "stages/calibration/scan/photo.h"
#include "stages/data/runs.h"
#include "stages/data/status.h"

namespace lamina::calibration {

/// What was to be printed. Lengths in mm of the image, from its upper left corner.
struct ExpectedLayer {
  RunsView image;
  double pixel_x_nm = 0, pixel_y_nm = 0;
  bool scan_along_x = true;
  double photo_um = 100;  // of a pixel of the photograph, within 5 %
};

/// A stripe along the scan in which nothing, or little, was printed.
struct MissingBand {
  double from_mm = 0, to_mm = 0;  // across the scan
  double missing_mm = 0;          // of it, by darkness
};

/// A connected part of the layer.
struct BodyReading {
  double x_mm = 0, y_mm = 0, expected_mm2 = 0, detected_mm2 = 0;  // the place is its middle
};

/// Ink where the layer has none. The place is its middle.
struct ExtraInk {
  double x_mm = 0, y_mm = 0, mm2 = 0;
};

struct Comparison {
  LayerPosition position;
  std::vector<MissingBand> bands;
  std::vector<BodyReading> bodies;
  std::vector<ExtraInk> extra;
};

/// Registers the photograph, at any rotation, by its content, and compares.
/// errors  kInput: the layer is empty, or the photograph does not show it, or is mirrored
/// cost    four seconds for a million pixels
Result<Comparison> compare_layer(const Photo& photo, const ExpectedLayer& layer);

}  // namespace lamina::calibration
