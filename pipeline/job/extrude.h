// pipeline/job/extrude.h: how a job is extruded: sections [extrude] and [segment].
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/text/changes.h"
#include "stages/segment/expand.h"

namespace lamina::pipeline {

template <class Target>
struct Key;

/// The keys of one segmentation, lengths in mm. What is absent follows from the machine's calibration.
struct SegmentSettings {
  bool on = false;
  segment::CutRule rule = segment::CutRule::kAligned;
  double thick_mm = 1.5, thin_mm = 1.5;
  std::optional<double> least_end_mm;  // absent: half of thick_mm
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
  std::vector<double> shift_mm{0};  // pores are moved along the lines by these, layer by layer in turn
  bool across = false;              // the grid begins so that pores of a layer turned by 90 degrees lie on the same places
};

/// The keys of one segmentation, in the order of a job file.
std::span<const Key<SegmentSettings>> segment_settings_keys();

/// Section [segment].
struct SegmentRequest {
  SegmentSettings all;
  std::vector<Range<SegmentSettings>> ranges;  // none overlaps another
  /// Whether any layer may be segmented.
  bool any() const { return all.on || !ranges.empty(); }
};

/// Section [extrude]: what a job changes of its machine, and where material goes to.
struct ExtrudeRequest {
  std::optional<double> flow, nozzle_degc, bed_degc, print_mm_s, wall_mm_s, first_layer_mm_s, travel_mm_s, retraction_mm,
      fan_percent;
  std::optional<bool> relative_extrusion;
  std::vector<std::pair<std::string, std::string>> machine;  // any other key of its profile and the value: fan.from_layer, 2
};

}  // namespace lamina::pipeline
