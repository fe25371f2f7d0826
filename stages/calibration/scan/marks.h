// stages/calibration/scan/marks.h: the four marks of a chart in a photograph.
#pragma once

#include <vector>

#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/view.h"
#include "stages/data/chart.h"
#include "stages/data/status.h"

namespace lamina::calibration {

/// The middle of a box, in mm of the image from its upper left corner.
inline Spot middle_of(const ChartBox& box, const Chart& chart) {
  return {(box.left + box.right) * 0.5e-6 * chart.pixel_x_nm, (box.top + box.bottom) * 0.5e-6 * chart.pixel_y_nm};
}

/// Finds discs and rings, however the sheet lies, and takes the view that puts the most dashes onto ink: of four marks, or of
/// three, where the place of the fourth is searched.
/// errors  kInput: fewer are there, or the photograph is mirrored
/// cost    some passes over the photograph; with three marks some millions of samples for each guess
Result<View> find_marks(const Photo& photo, const Chart& chart);

// --- dark patches of a photograph that may be the marks of a chart.

/// In pixels of the photograph.
struct Patch {
  Spot middle;
  double area = 0;
  double fullness = 0;  // area / area of the ellipse with its second moments: 1 of a disc, 0.6 of the ring
};

/// The likeliest of them, whole within the photograph.
struct Patches {
  std::vector<Patch> discs, rings;
};

/// level  darkness from which on a pixel counts, as a share of full ink
/// close  pixels of gaps that are bridged: lines of blocked nozzles cut a disc in two; 0: none
/// cost   two passes over the photograph
Patches find_patches(const Photo& photo, double level, int close);

/// Adds patches of another level; those that are there already stay as they are.
void add_patches(const Patches& more, Patches& patches);

}  // namespace lamina::calibration
