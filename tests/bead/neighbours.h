// tests/bead/neighbours.h: beads side by side that leave each other no room; volume is conserved in the cross-section.
//
// Each bead alone has two round sides. Where two reach each other they share the space between their centres: what would lie
// twice fills the cusps above and below the place where they touch. A stadium's cusps hold an overlap of (1 - pi/4) of the
// layer's height, 0.064 mm at 0.3 mm. What does not find room there fills the cusps of all beads that touch each other, in one
// proportion; the rest widens the two outer beads; where there is no outer side it stands above the layer. Assumed: beads that
// touch level out as one liquid, and nothing flows along the lines. No constant.
#pragma once

#include <span>

#include "stages/data/buffer.h"

namespace lamina::bead {

struct AdjacentBead {
  double centre_mm;  // across the lines, increasing
  double area_mm2;
  double width_mm;  // alone (line.h)
};

struct SqueezedBead {
  double left_mm, right_mm;  // its sides; where it touches a neighbour, the same as that one's
  bool touches_right;
  double cusps_mm2;  // that stay open between it and the neighbour at its right; 0 where they do not touch
  double height_mm;  // of the layer, or more where all room is taken

  double width() const { return right_mm - left_mm; }
};

/// out        one for each bead
/// period_mm  > 0: the beads repeat so far to the right, the last one touches the first of the next period
/// cost       O(beads) for each bead that is reached only because others were pushed outwards; usually O(beads)
void squeeze(std::span<const AdjacentBead> beads, double height_mm, double period_mm, Buffer<SqueezedBead>& out);

}  // namespace lamina::bead
