// stages/segment/calibration.h: what a printer makes of speed and extrusion, between the rows of its measured tables.
//
// Between measured values everything is in proportion; outside of them the nearest one holds and `inside` is false.
#pragma once

#include <optional>

#include "stages/data/extruder.h"
#include "stages/data/status.h"

namespace lamina::segment {

using lamina::Calibration;

/// Anet A8, PLA, nozzle 0.4 mm: Di Nisio 2022, Tables 6, 7 and 11 to 15 (means over the three regions of the part).
const Calibration& anet_a8_calibration();

/// Whether the tables are in order and positive. errors  kUsage, one line that begins with the table
Status check(const Calibration& calibration);

struct Reading {
  double value = 0;
  bool inside = true;  // of what was measured
};

/// Least width of a thin segment, and the longest thin segment that keeps its pore open, at a speed of 100 % and above.
Reading thin_width_at_speed(const Calibration& calibration, double percent);
Reading stable_distance(const Calibration& calibration, double percent);
/// Least width of a thin segment at that extrusion (100 % and below) and the reference speed.
Reading thin_width_at_extrusion(const Calibration& calibration, double percent);

/// Thick speed and widths for an extrusion that holds along the whole segmented line.
struct RepeatedReading {
  double thick_speed_percent, thick_mm, thin_mm, continuous_mm;
  bool inside;
};
RepeatedReading repeated_at(const Calibration& calibration, double extrusion_percent);

struct Spacing {
  double segmented, continuous;
};
/// Spacings settled on, in proportion between the extrusions; absent where the calibration holds none.
std::optional<Spacing> settled_spacing(const Calibration& calibration, double extrusion_percent);

/// Centre to centre, mm, so that a thick segment and a continuous line (two continuous lines) are `gap` apart.
/// Di Nisio 2022, Appendix A, step 5.
Spacing spacing_for(double thick_mm, double continuous_mm, double gap_mm);
/// The same as the document rounds it in its Tables 7 and 8: thick width to 0.01 mm, the set width for the continuous
/// one, half of their sum rounded half up to 0.01 mm.
double published_spacing(double thick_mm, double set_width_mm);

}  // namespace lamina::segment
