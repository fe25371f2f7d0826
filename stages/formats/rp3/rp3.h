// stages/formats/rp3/rp3.h: layer tables as the .rp3 files of M. V. A. de Lima (2009), Appendix B.
#pragma once

#include <array>
#include <span>
#include <string>

namespace lamina::formats::rp3 {

struct LayerSetting {
  double thickness_mm;
  double angle_deg;  // the flattest slope considered for the layer: 0 a wall, 90 a horizontal face
};

struct Settings {
  double contour_offset_mm = 0.508, raster_width_mm = 0.508;  // of the nozzle
  double first_angle_deg = 45, angle_step_deg = 90;           // of the filling; a layer's own angle follows from them
  std::array<double, 3> shrink{1, 1, 1}, rotation_deg{0, 0, 0};
};

/// The whole file: UTF-8, lines end with LF, columns are separated by tabs. README.md has the columns.
std::string text_of(std::span<const LayerSetting> layers, const Settings& settings);

}  // namespace lamina::formats::rp3
