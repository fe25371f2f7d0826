// stages/calibration/robust.h: middles and scatters that a few wrong values do not move, and what holds 99 measurements in 100.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace lamina::calibration {

/// Standard errors within which 99 in 100 measurements lie whose standard error is itself estimated: the 99.5 % quantile of
/// Student's t by Fisher's series (Abramowitz and Stegun 26.7.5), within 0.02 from 5 degrees of freedom on.
/// freedom  degrees of freedom of the standard error; fewer than 3 count as 3
inline double errors_of_99(double freedom) {
  constexpr double z = 2.5758293035489, z2 = z * z;
  const double n = std::max(freedom, 3.0);
  const double a = (z2 + 1) * z / 4, b = ((5 * z2 + 16) * z2 + 3) * z / 96, c = (((3 * z2 + 19) * z2 + 17) * z2 - 15) * z / 384,
               d = ((((79 * z2 + 776) * z2 + 1482) * z2 - 1920) * z2 - 945) * z / 92160;
  return z + (a + (b + (c + d / n) / n) / n) / n;
}

/// Of an even number, the mean of the two in the middle; 0 of none.
inline double median_of(std::vector<double> values) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
}

/// Of an even number, the upper of the two in the middle; 0 of none. values  are left in another order
template <class T>
double upper_median_of(std::vector<T>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return static_cast<double>(*middle);
}

/// The standard deviation that normal values of this median distance from `middle` have.
inline double scatter_of(const std::vector<double>& values, double middle) {
  std::vector<double> distances;
  for (const double value : values) distances.push_back(std::abs(value - middle));
  return 1.4826 * median_of(std::move(distances));
}

/// A mean without what lies far from the median, and the standard deviation of what it is of.
struct SettledMean {
  double mean = 0, deviation = 0;
  std::size_t count = 0;
};

/// scatter  that a value has at least: none within four of it is left out
inline SettledMean settled_mean(const std::vector<double>& values, double scatter) {
  const double middle = median_of(values), reach = 4 * std::max(scatter_of(values, middle), scatter);
  SettledMean settled{middle};
  double sum = 0, squares = 0;
  for (const double value : values) {
    if (std::abs(value - middle) > reach) continue;
    sum += value - middle;
    squares += (value - middle) * (value - middle);
    ++settled.count;
  }
  if (settled.count == 0) return settled;
  const double n = static_cast<double>(settled.count), off = sum / n;
  settled.mean = middle + off;
  if (settled.count > 1) settled.deviation = std::sqrt(std::max(squares - n * off * off, 0.0) / (n - 1));
  return settled;
}

}  // namespace lamina::calibration
