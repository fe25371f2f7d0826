// stages/calibration/scan/marks.h: the four marks of a chart in a photograph.
#pragma once

#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"
#include "stages/data/status.h"

namespace lamina::calibration {

/// The middle of a box, in mm of the image from its upper left corner.
inline Spot middle_of(const ChartBox& box, const Chart& chart) {
  return {(box.left + box.right) * 0.5e-6 * chart.pixel_x_nm, (box.top + box.bottom) * 0.5e-6 * chart.pixel_y_nm};
}

/// The size of a box in mm of the image, along x and y.
inline Spot size_of(const ChartBox& box, const Chart& chart) {
  return {(box.right - box.left) * 1e-6 * chart.pixel_x_nm, (box.bottom - box.top) * 1e-6 * chart.pixel_y_nm};
}

/// Of lengths along x and y, the one along the scan and the one across it.
inline double along_of(const Chart& chart, const Spot& xy) { return chart.scan_along_x ? xy.x : xy.y; }
inline double across_of(const Chart& chart, const Spot& xy) { return chart.scan_along_x ? xy.y : xy.x; }

/// Finds discs and rings, however the sheet lies, and takes the view that puts the most dashes onto ink: of four marks, or of
/// three, where the place of the fourth is searched.
/// errors  kInput: fewer are there, or the photograph is mirrored
/// cost    some passes over the photograph; with three marks some millions of samples for each guess
Result<View> find_marks(const Photo& photo, const Chart& chart);

}  // namespace lamina::calibration
