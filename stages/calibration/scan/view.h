// stages/calibration/scan/view.h: where a place of the sheet lies in a photograph.
#pragma once

#include <array>
#include <cmath>

namespace lamina::calibration {

struct Spot {
  double x = 0, y = 0;
};

/// A homography from mm of the sheet to pixels of the photograph, behind it one radial term of the lens about its middle.
///
/// w = 1 + h6 u + h7 v; x = (h0 u + h1 v + h2) / w, y = (h3 u + h4 v + h5) / w, u and v being the place in units of `unit`
/// about `middle`; then from the photograph's middle m, p = m + (p - m) (1 + lens |p - m|^2 / radius^2).
struct View {
  std::array<double, 8> h{1, 0, 0, 0, 1, 0, 0, 0};
  double lens = 0;
  Spot middle, photo_middle;  // mm, pixels
  double unit = 1, radius = 1;

  Spot at(double x_mm, double y_mm) const {
    const double u = (x_mm - middle.x) / unit, v = (y_mm - middle.y) / unit, w = 1 + h[6] * u + h[7] * v;
    const double x = (h[0] * u + h[1] * v + h[2]) / w - photo_middle.x, y = (h[3] * u + h[4] * v + h[5]) / w - photo_middle.y;
    const double grown = 1 + lens * (x * x + y * y) / (radius * radius);
    return {photo_middle.x + x * grown, photo_middle.y + y * grown};
  }
  /// Pixels a mm of the sheet there, geometric mean.
  double pixels_a_mm(double x_mm, double y_mm) const {
    const Spot a = at(x_mm, y_mm), b = at(x_mm + 0.1, y_mm), c = at(x_mm, y_mm + 0.1);
    return 10 * std::sqrt(std::abs((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x)));
  }
};

/// The view, without a lens, that takes four places to four pixels. False if three of either lie on a line.
bool view_of(const std::array<Spot, 4>& positions, const std::array<Spot, 4>& pixels, double width, double height, View& view);

}  // namespace lamina::calibration
