// stages/infill/gyroid.h: sections of a gyroid: a sparse filling that is about equally stiff in all directions.
//
// The surface is sin x cos y + sin y cos z + sin z cos x = 0, a close approximation of the one of A. Schoen, Infinite periodic
// minimal surfaces without self-intersections, NASA TN D-5541 (1970). In a layer z is constant: where sin^2 z >= 1/2 the curves
// are graphs x(y), else y(x), two in each period, since a sin u + b cos u = c has two solutions.
#pragma once

#include <cstdint>

#include "stages/data/contours.h"
#include "stages/data/units.h"

namespace lamina::infill {

/// The length of the curves of a plane over area / period; the mean over all heights.
double gyroid_length();

/// The curves of one plane.
class GyroidSection {
 public:
  /// z, period  nm; period > 0
  GyroidSection(double z, double period);

  /// Appends the curves that may meet a box, in the order of their numbers, open.
  void append_curves(Point2 low, Point2 high, Contours& out) const;
  /// How many points these have. cost  O(1)
  std::uint64_t count_points(Point2 low, Point2 high) const;
  /// The number of the curve that is next to a point. Curves are numbered across.
  std::int64_t nearest_curve(Point2 p) const;
  /// Where a point is along the curves, nm.
  Nm along(Point2 p) const { return over_y_ ? p.y : p.x; }

 private:
  struct NumberInterval {
    std::int64_t first, last;
  };
  /// The first of the two positions across, in radians, at a position along; the second is `width` further.
  struct Across {
    double first, width;
  };
  Across across_at(double along) const;
  NumberInterval steps(Point2 low, Point2 high) const;
  NumberInterval curves(Point2 low, Point2 high) const;

  bool over_y_;
  double sin_z_, cos_z_, period_;
};

}  // namespace lamina::infill
