#include "stages/calibration/chart/rows.h"

#include <algorithm>
#include <cmath>

#include "stages/calibration/robust.h"

namespace lamina::calibration {
namespace {

std::optional<Located> mean_of(const std::vector<Located>& row) {
  constexpr double kFar = 4;  // standard errors
  if (row.empty()) return std::nullopt;
  std::vector<double> positions, errors;
  for (const Located& one : row) {
    positions.push_back(one.um);
    errors.push_back(one.error_um);
  }
  // Of the head's own: the standard deviation that normal values have, less what errors make of it.
  const double middle = median_of(positions);
  const double all = scatter_of(positions, middle), error = median_of(errors), own = std::max(all * all - error * error, 0.0);
  double weights = 0, sum = 0, squares = 0, count = 0;
  for (const Located& one : row) {
    const double off = one.um - middle, variance = std::max(one.error_um * one.error_um + own, 1e-6);
    if (off * off > kFar * kFar * variance) continue;
    weights += 1 / variance;
    sum += off / variance;
    squares += off * off / (variance * variance);
    ++count;
  }
  if (weights == 0) return std::nullopt;
  const double error_um = std::max(std::sqrt(squares), std::sqrt(weights)) / weights;
  return Located{middle + sum / weights, error_um, errors_of_99(count - 1) * error_um};
}

}  // namespace

std::vector<std::optional<Located>> rows_of(const std::vector<std::optional<Located>>& nozzles, std::uint32_t rows) {
  std::vector<std::vector<Located>> of_row(rows);
  for (std::size_t n = 0; n < nozzles.size(); ++n) {
    if (nozzles[n]) of_row[n % rows].push_back(*nozzles[n]);
  }
  std::vector<std::optional<Located>> reported(rows);
  const auto first = mean_of(of_row[0]);
  if (!first) return reported;
  reported[0] = Located{};
  for (std::uint32_t r = 1; r < rows; ++r) {
    const auto mean = mean_of(of_row[r]);
    if (mean)
      reported[r] = Located{mean->um - first->um, std::hypot(mean->error_um, first->error_um),
                            std::hypot(mean->within_um, first->within_um)};
  }
  return reported;
}

}  // namespace lamina::calibration
