// stages/bead/pattern.h: thick and thin stretches in turn, without end: the widths that they settle on.
#pragma once

#include "stages/bead/line.h"

namespace lamina::bead {

/// Of one extrusion: the pattern of Di Nisio 2022, section 3.2.4.
struct Pattern {
  double thick_mm, thin_mm;  // > 0
  double extrusion_percent;
  double thick_speed_mm_s, thin_speed_mm_s;
};

/// What a stretch is like, mm.
struct StretchWidths {
  double middle, mean;  // in its middle; over its length
  double least, largest;
};

struct PatternWidths {
  StretchWidths thick, thin;
  double fed_mm3;     // in a period, and laid as well
  double flow_mm3_s;  // with which a thick stretch begins
  double peak_mm_s;   // what the head reaches in the thin stretch
  double period_s;
};

/// One period in its steady state, thick first, from the place 0.
void lay_steady(const BeadMachine& machine, double height_mm, const Pattern& pattern, const TakePiece& take,
                double tolerance_mm = 0.005);

/// spread  the bead spreads along its line (spread.h); widths are then those of cells of 0.02 mm at most
/// cost    some hundred exponentials without spread, some ten thousand arc sines with it
PatternWidths steady_widths(const BeadMachine& machine, double height_mm, const Pattern& pattern, bool spread);

}  // namespace lamina::bead
