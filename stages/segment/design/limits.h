// stages/segment/design/limits.h: what of a segmented filling may be chosen for a machine, and what of that was measured.
#pragma once

#include <array>
#include <cstdint>

#include "stages/data/extruder.h"
#include "stages/data/status.h"
#include "stages/segment/calibration.h"
#include "stages/segment/predict.h"
#include "stages/segment/settings.h"

namespace lamina::segment {

/// What is free: lengths of stretches, what lies between thick beads and their neighbours (below 0: overlap), the extrusion of
/// segmented lines, and how many continuous ones lie between two of them. Speeds follow from the extrusion.
struct Choice {
  std::uint32_t continuous = 1;
  double extrusion = 100;  // %
  double thick_mm = 1.5, thin_mm = 1.5, gap_mm = 0;
};

struct Interval {
  double minimum = 0, maximum = 0;
  double near(double value) const { return value < minimum ? minimum : value > maximum ? maximum : value; }
};

/// Bounds of choices for a machine.
class DesignLimits {
 public:
  /// calibration  has to outlive it
  /// errors       kUsage: no widths of repeated stretches, or at other speeds than 200 %; no thin stretch reaches its speed
  static Result<DesignLimits> of(const Extruder& machine, const Calibration& calibration);

  /// Lines between two segmented ones: those of Di Nisio 2022, Table 8.
  static constexpr std::uint32_t kMaxContinuous = 3;

  Interval extrusion() const { return extrusion_; }
  /// The nearest choice that can be laid. Thin stretches are long enough for the machine to come to three quarters of their
  /// speed, and to keep a pore of 0.3 mm between thick beads; at most half as long as it takes the bead to be as wide as
  /// before. Pores are at least 0.03 mm wide: 0.02 mm are bonded. Thick beads overlap their neighbours by at most 0.02 mm, and
  /// stay away by no more than 0.02 mm. Lengths of thick stretches are between 1 and 2.4 mm.
  Choice nearest(Choice choice) const;

  /// The key's values, as they are written: lengths to a micrometre, spacings to 0.1 um, percent to 0.1.
  SegmentSettings settings_of(const Choice& choice) const;
  /// The plan with the widths that the machine's beads will have. errors  of resolve()
  Result<Segmentation> plan_of(const Choice& choice) const;
  Result<Segmentation> plan_of(const SegmentSettings& settings) const;

  /// The plan with the widths that toolpaths are written with: that of continuous lines is of what 100 % lays, not what was
  /// measured. A better model of beads has its place here.
  Segmentation deposited(Segmentation plan) const;

  /// How far a choice is from what was measured, 0 where it was: extrusion, thick, thin, gap; 1 is far.
  std::array<double, 4> beyond(const Choice& choice) const;

  const Calibration& calibration() const { return *calibration_; }

 private:
  const Calibration* calibration_ = nullptr;
  Interval extrusion_;
  double speed_mm_s_ = 0, acceleration_ = 0, max_thin_ = 0, continuous_mm_ = 0;
};

}  // namespace lamina::segment
