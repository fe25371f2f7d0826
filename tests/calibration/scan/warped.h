// tests/calibration/scan/warped.h: photographs by other means than synthetic.h has: ink as hard cells, warped and resampled by
// OpenCV, the camera's own curve of greys, colours, JPEG. Nothing but the layer is shared.
#pragma once

#include <cstdint>
#include <functional>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "stages/data/runs.h"

namespace lamina::test {

/// Ink on white, a cell a hundredth of a millimetre; lengths in mm of the layer's image, from its upper left corner.
struct InkedSheet {
  static constexpr double kCellsAMm = 100;
  double left_mm = 0, top_mm = 0;
  cv::Mat cells;  // CV_8U, 255 white
};

/// shift_mm  of what lies on a row of the image; none: it is not printed
InkedSheet inked_sheet(const RunsView& layer, double pixel_x_mm, double pixel_y_mm,
                       const std::function<std::optional<cv::Point2d>(std::uint32_t)>& shift_mm, double margin_mm = 6);

struct Shot {
  double pixels_a_mm = 20, turn_deg = 0, keystone = 0;  // of the picture's width, at its upper edge
  int finer = 3;          // cells of a pixel a side that are averaged; 1: a pixel is one sample of the sheet, hard edges
  int interpolation = 1;  // cv::InterpolationFlags
  double blur_pixels = 0, noise = 0;
  double gamma = 2.2;
  int jpeg_quality = 90;  // 0: a PNG
  std::uint64_t seed = 1;
};

/// Writes the photograph of a sheet: `path` with .jpg or .png behind it. returns  that name
std::string photograph_to(const std::string& path, const InkedSheet& sheet, const Shot& shot);

}  // namespace lamina::test
