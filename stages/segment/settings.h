// stages/segment/settings.h: how lines are segmented, in the units of people.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

namespace lamina::segment {

enum class CutRule : std::uint8_t {
  kGrid,       // Fukuda: on a grid fixed to the part, thin first; a line between two marks is not divided
  kThickEnds,  // Di Nisio: both ends thick; what the pattern leaves over is shared by them
  kAligned     // on the grid, but a thin stretch that the line does not hold whole, and clear of its ends, is thick
};

/// One segmentation as people describe it, lengths in mm; resolve() decides what is absent by a calibration.
struct SegmentSettings {
  bool on = false;
  CutRule rule = CutRule::kAligned;
  double thick_mm = 1.5, thin_mm = 1.5;
  std::optional<double> min_end_mm;  // absent: half of thick_mm
  std::uint32_t continuous = 1;
  std::int32_t first = 0;
  std::optional<double> spacing_sc_mm, spacing_cc_mm;  // centre to centre
  double gap_mm = 0;                                   // wanted between beads, for spacings that are not given
  double thick_extrusion = 100;
  std::optional<double> thin_extrusion;  // absent: as the thick one
  std::optional<double> thick_speed;     // absent: by the extrusion
  double thin_speed = 200;
  std::vector<double> thin_speed_sweep, thin_extrusion_sweep;  // of segmented lines, in turn; test pieces of a calibration
  std::optional<double> thick_width_mm, thin_width_mm, continuous_width_mm;  // that beads will have
  bool one_direction = true;
  bool even_starts = true;  // lines begin with the flow they keep (stages/bead/even_starts.h), if the machine's lag is known
  std::vector<double> shift_mm{0};  // pores are moved along the lines by these, layer by layer in turn
  bool across = false;              // the grid begins so that pores of a layer turned by 90 degrees lie on the same places
};

}  // namespace lamina::segment
