// stages/bead/machine.h: the bead parameters of a machine, and the commands that deposit beads.
//
// A bead is predicted from three numbers of a machine and from the volume it is fed; no table of widths is used.
#pragma once

#include <limits>

#include "stages/data/status.h"

namespace lamina::bead {

/// A calibration for the model. Nothing else of a machine enters it.
struct BeadMachine {
  double area_mm2 = 0;  // cross-section of 100 %: bead_area x flow of the profile
  /// The melt follows the feed with this lag, s; 0: deposits at once what is fed. Anet A8: time_constant() in stabilisation.h.
  double tau_s = 0;
  /// Of the head along a line. Infinite: speeds change at once.
  double acceleration_mm_s2 = std::numeric_limits<double>::infinity();
};

/// Whether beads can be predicted for it. errors  kUsage, one line that begins with the number's name
Status check(const BeadMachine& machine);

/// A straight piece of a line as it is commanded.
struct LineSegment {
  double length_mm;   // > 0
  double area_mm2;    // that is fed for each mm, >= 0: area of 100 % x extrusion
  double speed_mm_s;  // > 0; reached if the stretch is long enough
};

/// How a line begins, or has ended: what the line before left behind.
struct Joint {
  double speed_mm_s = 0;  // of the head
  double flow_mm3_s = 0;  // that leaves the nozzle
  bool pressed = true;    // the bead stays between nozzle and layer (section.h)
};

}  // namespace lamina::bead
