#include "stages/calibration/scan/shape.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stages/geometry/least_squares.h"

namespace lamina::scan {

Shape::Shape(double reach, double step)
    : step_(step), sum_(static_cast<std::size_t>(std::ceil(reach / step)) + 2, 0), weight_(sum_.size(), 0) {}

void Shape::add(const Profile& profile, double middle, double ground) {
  for (std::size_t i = 0; i < profile.value.size(); ++i) {
    const double at = std::abs(profile.place(i) - middle) / step_;
    const auto cell = static_cast<std::size_t>(at);
    if (cell + 1 >= sum_.size()) continue;
    const double share = at - static_cast<double>(cell), value = profile.value[i] - ground;
    sum_[cell] += (1 - share) * value;
    weight_[cell] += 1 - share;
    sum_[cell + 1] += share * value;
    weight_[cell + 1] += share;
  }
}

void Shape::settle() {
  for (std::size_t i = 0; i < sum_.size(); ++i) sum_[i] = weight_[i] > 0 ? sum_[i] / weight_[i] : i > 0 ? sum_[i - 1] : 0;
  const double highest = *std::ranges::max_element(sum_);
  if (highest > 0) {
    for (double& value : sum_) value /= highest;
  }
}

double Shape::at(double x) const {
  const double at = std::abs(x) / step_;
  const auto cell = static_cast<std::size_t>(at);
  if (cell + 1 >= sum_.size()) return sum_.back();
  return sum_[cell] + (at - static_cast<double>(cell)) * (sum_[cell + 1] - sum_[cell]);
}

double Shape::slope_at(double x) const { return (at(x + step_) - at(x - step_)) / (2 * step_); }

ShapeFit fit_shape(const Profile& profile, const Shape& shape, double middle, double reach, double most) {
  ShapeFit fit{.middle = middle};
  for (int step = 0; step < 5; ++step) {
    // First ground and height, then the middle too.
    LeastSquares linear(3);
    double squares = 0, count = 0;
    for (std::size_t i = 0; i < profile.value.size(); ++i) {
      const double at = profile.place(i) - fit.middle;
      if (std::abs(at) > reach) continue;
      const std::array<double, 3> slope{1, shape.at(at), step == 0 ? 0 : -fit.height * shape.slope_at(at)};
      const double left = profile.value[i] - fit.ground - fit.height * slope[1];
      linear.add(slope, left);
      squares += left * left;
      ++count;
    }
    if (count < 5) return fit;
    fit.misfit = std::sqrt(squares / count);
    linear.damp(1e-9, 1e-18);
    std::array<double, 3> change{};
    if (!linear.solve(change)) return fit;
    fit.ground += change[0];
    fit.height += change[1];
    if (step > 0) fit.middle = std::clamp(fit.middle + change[2], middle - most, middle + most);
  }
  return fit;
}

}  // namespace lamina::scan
