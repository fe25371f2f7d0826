// stages/segment/predict.h: what a segmented filling will be, before anything is printed.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/status.h"
#include "stages/data/units.h"
#include "stages/segment/calibration.h"
#include "stages/segment/cut.h"

namespace lamina::segment {

/// How segmented lines are laid: the parameters of Di Nisio 2022, Table 1, in mm and %.
struct Segmentation {
  CutRule rule = CutRule::kAligned;
  double thick_mm = 1.5, thin_mm = 1.5;
  double min_end_mm = 0.75;
  std::uint32_t continuous = 1;
  double spacing_sc_mm = 0.43, spacing_cc_mm = 0.40;  // centre to centre
  double thick_extrusion = 100, thin_extrusion = 100;
  double thick_speed = 75, thin_speed = 200;
  double thick_width_mm = 0.45, thin_width_mm = 0.31, continuous_width_mm = 0.39;  // that beads will have

  /// Thin stretches of one segmented line, where lines differ: what is varied on a test piece.
  struct ThinLine {
    double extrusion, speed, width_mm;
  };
  std::vector<ThinLine> sweep;  // of segmented lines in turn, from the first one; empty: all alike
  /// That of segmented line k (negative before the first); also without a sweep.
  ThinLine thin_of(std::int64_t k) const {
    if (sweep.empty()) return {thin_extrusion, thin_speed, thin_width_mm};
    const auto size = static_cast<std::int64_t>(sweep.size());
    return sweep[static_cast<std::size_t>(k - floor_div(k, size) * size)];
  }
};

/// Whether it can be laid. errors  kUsage, one line that begins with the key's name (as in [segment])
Status check(const Segmentation& segmentation, double bead_width_mm);

/// What a user should know, of the code "pores": a pore that closes, speeds outside of what was measured, beads that do not
/// touch.
std::vector<Warning> warnings(const Segmentation& segmentation, const Calibration& calibration);

/// A pore between a thin stretch and the continuous line next to it (pore_geometry.h).
struct Pores {
  double length_mm, width_mm;
  double aspect;       // width / length
  double density_mm2;  // pores in a mm2 of a layer: two at each thin stretch
};
Pores predict_pores(const Segmentation& segmentation);

}  // namespace lamina::segment
