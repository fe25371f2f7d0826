// stages/bead/predicted_tables.h: calibration tables predicted by the model, for machines without measured ones.
//
// Test pieces are those of Di Nisio 2022: a thin segment between long thick ones, by speed (Table 11) and by extrusion (Table
// 12), and alternating segments of 1.5 mm (Tables 13 to 15). Comparison with its measurements: tests/bead/test_tables.cpp.
#pragma once

#include "stages/bead/line.h"
#include "stages/data/extruder.h"

namespace lamina::bead {

/// machine     area_mm2 > 0 and tau_s > 0
/// width_mm    requested width of 100 % extrusion; widths of the tables are those of the model
/// height_mm   of the layer
/// speed_mm_s  that 100 % means
/// cost        some milliseconds
Calibration predicted_tables(const BeadMachine& machine, double width_mm, double height_mm, double speed_mm_s);

// --- thick and thin stretches in turn, without end: the widths that they settle on.

/// Of one extrusion: the pattern of Di Nisio 2022, section 3.2.4.
struct Pattern {
  double thick_mm, thin_mm;  // > 0
  double extrusion_percent;
  double thick_speed_mm_s, thin_speed_mm_s;
};

/// What a stretch is like, mm.
struct IntervalWidths {
  double middle, mean;  // in its middle; over its length
  double minimum, largest;
};

/// Of a period.
struct PatternSums {
  double fed_mm3;  // and deposited
  double seconds;
  double flow_mm3_s;  // with which a thick stretch begins
  double peak_mm_s;   // that the head reaches in a thin stretch
};

struct PatternWidths {
  IntervalWidths thick, thin;
  PatternSums sums;
};

/// A piece of a period, mm from where its thick stretch begins; the width between its ends is in proportion.
struct ProfilePiece {
  double begin_mm, end_mm, begin_width_mm, end_width_mm;
  double width_at(double position) const {
    return begin_width_mm + (end_width_mm - begin_width_mm) * (position - begin_mm) / (end_mm - begin_mm);
  }
};
using TakeProfile = std::function<void(const ProfilePiece&)>;

/// The widths of one period, without gaps and in order.
/// spread  the bead spreads along its line (spread.h); widths are then those of cells of 0.02 mm at most
/// cost    some hundred exponentials without spread, some ten thousand numbers from a table with it
PatternSums steady_profile(const BeadMachine& machine, double height_mm, const Pattern& pattern, bool spread,
                           const TakeProfile& take);
PatternWidths steady_widths(const BeadMachine& machine, double height_mm, const Pattern& pattern, bool spread);

}  // namespace lamina::bead
