// stages/segment/calibration.h: what a printer makes of speed and extrusion: measured tables.
//
// Percentages are relative to the reference: 100 % extrusion gives the set width at the set height, 100 % speed is that of
// walls and continuous lines. Between measured values everything is in proportion; outside of them the nearest one holds
// and `inside` is false.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stages/data/status.h"

namespace lamina::segment {

struct Calibration {
  std::string source;                                       // of the numbers, for people
  double width_mm = 0.4, height_mm = 0.3, speed_mm_s = 15;  // what 100 % means

  /// A thin stretch between long thick ones, by its speed; extrusion 100 %.
  struct BySpeed {
    double percent, thin_mm;
    double stable_mm;  // after this distance the bead is as wide as before: a longer thin stretch closes its pore
    double swell_mm;   // width of the thick stretch that follows, at its widest
  };
  std::vector<BySpeed> by_speed;  // percent increasing, above 100

  /// A thin stretch by its extrusion; speed 100 %.
  struct ByExtrusion {
    double percent, thin_mm;
  };
  std::vector<ByExtrusion> by_extrusion;  // percent decreasing, below 100

  /// Short thick and thin stretches in turn: the thick speed that keeps widths the same along the part, and the widths.
  struct Repeated {
    double extrusion_percent, thin_speed_percent, thick_speed_percent;
    double thick_mm, thin_mm, continuous_mm;
  };
  std::vector<Repeated> repeated;  // extrusion increasing

  /// Spacings that were settled on for an extrusion, centre to centre; where there are none they follow from the widths.
  struct Spaced {
    double extrusion_percent, segmented_mm, continuous_mm;
  };
  std::vector<Spaced> spacing;  // extrusion increasing
};

/// Anet A8, PLA, nozzle 0.4 mm: Di Nisio 2022, Tables 6, 7 and 11 to 15 (means over the three regions of the part).
const Calibration& anet_a8_calibration();

/// Whether the tables are in order and positive. errors  kUsage, one line that begins with the table
Status check(const Calibration& calibration);

struct Reading {
  double value = 0;
  bool inside = true;  // of what was measured
};

/// Least width of a thin stretch, and the longest thin stretch that keeps its pore open, at a speed of 100 % and above.
Reading thin_width_at_speed(const Calibration& calibration, double percent);
Reading stable_distance(const Calibration& calibration, double percent);
/// Least width of a thin stretch at that extrusion (100 % and below) and the reference speed.
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

/// Centre to centre, mm, so that a thick stretch and a continuous line (two continuous lines) are `gap` apart.
/// Di Nisio 2022, Appendix A, step 5.
Spacing spacing_for(double thick_mm, double continuous_mm, double gap_mm);
/// The same as the document rounds it in its Tables 7 and 8: thick width to 0.01 mm, the set width for the continuous
/// one, half of their sum rounded half up to 0.01 mm.
double published_spacing(double thick_mm, double set_width_mm);

}  // namespace lamina::segment
