// stages/calibration/scan/shape.h: profiles that look alike, and where one of them lies: by their common shape, not by a level
// or a centre.
#pragma once

#include <vector>

namespace lamina::scan {

/// Values at places that are evenly spaced about zero.
struct Profile {
  std::vector<double> value;
  double step = 1;
  double place(std::size_t i) const { return (static_cast<double>(i) - 0.5 * static_cast<double>(value.size() - 1)) * step; }
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
ShapeFit fit_shape(const Profile& profile, const Shape& shape, double middle, double reach, double most);

}  // namespace lamina::scan
