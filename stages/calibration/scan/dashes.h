// stages/calibration/scan/dashes.h: what is detected of each dash of a chart.
#pragma once

#include <optional>
#include <vector>

#include "stages/calibration/scan/photo.h"
#include "stages/calibration/scan/sheet_fit.h"
#include "stages/data/chart.h"

namespace lamina::calibration {

// --- similar profiles, and the position of one of them: by their common shape, not by a level or a centre.

/// Values at places that are evenly spaced about zero.
struct Profile {
  std::vector<double> value;
  double step = 1;
  double position(std::size_t i) const { return (static_cast<double>(i) - 0.5 * static_cast<double>(value.size() - 1)) * step; }
};

/// The mean of many profiles, each about its own middle, folded there: even, so that nothing draws a fit to one side.
class Shape {
 public:
  /// reach  beyond which the shape is what it is there; step  of its table; same unit as places
  Shape(double reach, double step);
  void add(const Profile& profile, double middle, double ground);
  /// Ends the adding: a mean, 1 at its highest.
  void settle();
  double at(double x) const;
  double slope_at(double x) const;

 private:
  double step_;
  std::vector<double> sum_, weight_;
};

/// ground + height x shape(place - middle), by least squares within `reach` of the middle.
struct ShapeFit {
  double middle = 0, height = 0, ground = 0;
  double misfit = 0;  // root mean square of what is left
};

/// middle  where it begins; it moves by at most `most`
ShapeFit fit_shape(const Profile& profile, const Shape& shape, double middle, double reach, double maximum);

// ---

/// Lengths in mm of the sheet, in the directions of x and y of its image.
struct DashReading {
  double mass = 0;      // darkness across the dash, summed: mm of full black
  double ground = 0;    // darkness next to it
  Spot position;        // of its middle; meaningful if it is there
  bool there = false;   // it was printed
  bool hidden = false;  // too dark for a dash, or out of the picture: not readable
  double misfit = 0;    // from the common shape, as a share of its height
  bool marred = false;  // by dust: it is there, but its place is not to be trusted
};

/// The common shapes of all dashes of a photograph, across the scan and along it.
struct DashShapes {
  Shape across, along;
};

/// Inspects each dash at its position by the fit.
/// shapes   locate the dashes if given, else centres and ends do; replaced by the detected shapes
/// returns  one for each dash of the chart
/// cost     some thousand samples a dash
std::vector<DashReading> see_dashes(const Photo& photo, const Chart& chart, const SheetFit& fit,
                                    std::optional<DashShapes>& shapes);

/// Darkness along a line, averaged over a stripe about it: from -reach to reach, evenly; empty if it leaves the picture.
/// reach, half  mm, of the line on either side of the middle and of the stripe's width
std::vector<double> stripe(const Photo& photo, const View& view, const Spot& middle, bool along_x, double reach, double half);

}  // namespace lamina::calibration
