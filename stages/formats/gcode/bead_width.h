// stages/formats/gcode/bead_width.h: the width of a bead from what is fed.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/formats/gcode/commands.h"

namespace lamina::read {

inline constexpr double kUsualHeight = 0.2;  // mm, of a layer of which nothing is known
inline constexpr double kRoundSides = 1 - std::numbers::pi / 4;

/// mm3 of a fed unit: of a mm of filament, or of one that is counted in mm3.
inline double volume_of_unit(bool volumetric, double filament_mm) {
  return volumetric ? 1 : std::numbers::pi * filament_mm * filament_mm / 4;
}

/// The height of a bead, mm. layer_height, below  of GcodeFile::LayerPlace
inline double height_of(const RawBead& bead, double tag, double layer_height, double below) {
  if (tag > 0) return tag;
  if (layer_height > 0) return layer_height;
  if (!(bead.to[2] > below)) return kUsualHeight;
  // The start of a slope lies on the layer below: a bead of no height is as wide as the plane.
  return bead.from[2] == bead.to[2] ? bead.to[2] - below : std::max(bead.to[2] - below, 0.05);
}

/// Width of a rectangle with half circles at its sides that holds what was fed; mm.
inline double width_of(const RawBead& bead, double height, double unit_mm3) {
  const double width = bead.fed * unit_mm3 / bead.length() / height + height * kRoundSides;
  return std::clamp(std::round(width * 100) / 100, 0.01, 20.0);
}

}  // namespace lamina::read
