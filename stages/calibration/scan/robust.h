// stages/calibration/scan/robust.h: middles and scatters that a few wrong values do not move.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace lamina::calibration {

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
