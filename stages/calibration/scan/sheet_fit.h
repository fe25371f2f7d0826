// stages/calibration/scan/sheet_fit.h: the position of a place of the sheet in a photograph: the view of a chart, the shifts of
// its swaths and the offsets of its nozzles, from where dashes lie.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

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

/// A dash: where it should lie on the sheet in mm, and where the photograph has it, in pixels.
struct Sighting {
  Spot position, detected;
  std::uint32_t swath = 0, nozzle = 0, repeat = 0;
};

/// A dash is detected at its view.at() position, moved by the shift of its swath and the offset of its nozzle, in mm.
struct SheetFit {
  View view;
  std::vector<Spot> shift;    // of each swath; the one that shifts count from has none
  std::vector<Spot> offset;   // of each nozzle; undetected ones have none
  double scatter_pixels = 0;  // median distance of a dash from there
};

/// All of them together, by Gauss and Newton with Tukey's weights: outliers (dust) count nothing. A nozzle's own offset is an
/// unknown, so that it bends neither the view nor the shifts. What cannot be determined (a straight line through the offsets
/// against the scale of the view and the shifts) is kept small. fit    where it begins, of all swaths and nozzles; changed
/// first  the swath that shifts count from lens   whether to fit one cost   O(sightings x unknowns of view and swaths^2) for
/// each of some ten steps
void fit_sheet(const std::vector<Sighting>& sightings, std::uint32_t first, bool lens, SheetFit& fit);

/// The straight line, value = middle + slope x index, whose slope is the median of all pairs' (Theil 1950, Sen 1968) and which
/// has as many values above as below. values  of index, by pairs; at least one
/// cost  O(pairs), of at most some 500 values evenly chosen
struct HeadLine {
  double middle = 0, slope = 0;
  double at(double index) const { return middle + slope * index; }
};
HeadLine line_of(const std::vector<std::pair<double, double>>& values);

}  // namespace lamina::calibration
