// stages/calibration/scan/patches.h: dark patches of a photograph that may be the marks of a chart.
#pragma once

#include <vector>

#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/view.h"

namespace lamina::scan {

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

}  // namespace lamina::scan
