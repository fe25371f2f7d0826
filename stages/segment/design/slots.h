// stages/segment/design/slots.h: the pores of a segmented filling as slots between beads: porosity and permeability in
// microseconds.
//
// Layers lie upon each other without a turn, so pores of all layers make one channel next to each thin segment, along z.
#pragma once

#include "stages/segment/predict.h"

namespace lamina::segment {

/// One period of a plan: two pores, mirror images of each other, and what lies between continuous lines.
struct Slots {
  double porosity = 0;         // void / volume, cusps between beads included
  double permeability_m2 = 0;  // Darcy's k1 along z
  double throat_mm = 0;        // the largest ball that passes along z
};

/// Beads are stadia as high as their layer, with round ends; one narrower than its layer is high is round. They keep their
/// widths where they overlap. At each position along the line the fluid flows along z through a gap that varies with height:
/// its resistance is the mean over the layer of 12 / gap^3. What flows along the line and across it is left out, and that
/// walls are not parallel, so that wide gaps of short pores are given too permeable; the order of plans is right.
/// plan      checked (predict.h), without a sweep; rules of ends have no part in it
/// layer_mm  > 0
/// source    the cubic law: P. A. Witherspoon, J. S. Y. Wang, K. Iwai, J. E. Gale, "Validity of cubic law for fluid flow in a
///           deformable rock fracture", Water Resour. Res. 16 (1980)
/// cost      some thousand roots, 20 microseconds
Slots slots_of(const Segmentation& plan, double layer_mm);

}  // namespace lamina::segment
