#include "stages/geometry/least_squares.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace lamina {

void LeastSquares::add(std::span<const double> row, double value, double weight) {
  for (std::size_t i = 0; i < row.size(); ++i) {
    const double factor = weight * row[i];
    right_[i] += factor * value;
    for (std::size_t j = 0; j <= i; ++j) at(i, j) += factor * row[j];
  }
}

void LeastSquares::damp(double relative, double absolute) {
  for (std::size_t i = 0; i < right_.size(); ++i) at(i, i) += relative * at(i, i) + absolute;
}

bool LeastSquares::solve(std::span<double> x) const {
  constexpr double kDependent = 1e-13;
  const auto size = static_cast<Eigen::Index>(right_.size());
  // Columns of length 1, so that pivots compare.
  const Eigen::Map<const Eigen::Matrix<double, -1, -1, Eigen::RowMajor>> square(square_.data(), size, size);
  Eigen::VectorXd scale(size), right(size);
  for (Eigen::Index i = 0; i < size; ++i) {
    scale(i) = square(i, i) > 0 ? 1 / std::sqrt(square(i, i)) : 0;
    right(i) = scale(i) * right_[static_cast<std::size_t>(i)];
  }
  Eigen::MatrixXd scaled(size, size);
  for (Eigen::Index i = 0; i < size; ++i) {
    for (Eigen::Index j = 0; j < i; ++j) scaled(i, j) = scale(i) * square(i, j) * scale(j);
    scaled(i, i) = 1;
  }
  const Eigen::LDLT<Eigen::MatrixXd> factors(scaled);
  if (!(factors.vectorD().array() > kDependent).all()) return false;
  const Eigen::VectorXd found = factors.solve(right).cwiseProduct(scale);
  if (!found.allFinite()) return false;
  std::copy_n(found.data(), size, x.begin());
  return true;
}

GroupedLeastSquares::GroupedLeastSquares(std::size_t shared, std::size_t groups, std::size_t own)
    : shared_(shared), group_(groups, LeastSquares(own)), mixed_(groups * own * shared, 0) {}

void GroupedLeastSquares::add(std::span<const Term> shared, std::size_t group, std::span<const double> own, double value,
                              double weight) {
  double* mixed = mixed_.data() + group * own.size() * shared_.right_.size();
  for (const Term& one : shared) {
    const double factor = weight * one.factor;
    shared_.right_[one.unknown] += factor * value;
    for (const Term& other : shared) {
      if (other.unknown <= one.unknown) shared_.at(one.unknown, other.unknown) += factor * other.factor;
    }
    for (std::size_t i = 0; i < own.size(); ++i) mixed[i * shared_.right_.size() + one.unknown] += factor * own[i];
  }
  group_[group].add(own, value, weight);
}

bool GroupedLeastSquares::solve(double relative, std::span<double> shared, std::span<double> own) const {
  const std::size_t count = shared_.right_.size(), size = group_.empty() ? 0 : group_.front().right_.size();
  LeastSquares reduced = shared_;
  // A group's unknowns are free - share * shared ones.
  std::vector<double> share(mixed_.size(), 0), free(own.size(), 0), inverse(size * size);
  for (std::size_t g = 0; g < group_.size(); ++g) {
    LeastSquares unit = group_[g];
    for (std::size_t i = 0; i < size; ++i) {
      std::ranges::fill(unit.right_, 0);
      unit.right_[i] = 1;
      if (!unit.solve(std::span(inverse).subspan(i * size, size))) return false;
    }
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        const double factor = inverse[i * size + j], *mixed = mixed_.data() + (g * size + j) * count;
        free[g * size + i] += factor * group_[g].right_[j];
        for (std::size_t k = 0; k < count; ++k) share[(g * size + i) * count + k] += factor * mixed[k];
      }
    }
    for (std::size_t i = 0; i < size; ++i) {
      const double *mixed = mixed_.data() + (g * size + i) * count, *of_group = share.data() + (g * size + i) * count;
      for (std::size_t k = 0; k < count; ++k) {
        reduced.right_[k] -= mixed[k] * free[g * size + i];
        for (std::size_t l = 0; l <= k; ++l) reduced.at(k, l) -= mixed[k] * of_group[l];
      }
    }
  }
  reduced.damp(relative, 0);
  if (!reduced.solve(shared)) return false;
  for (std::size_t g = 0; g < group_.size(); ++g) {
    for (std::size_t i = 0; i < size; ++i) {
      double value = free[g * size + i];
      for (std::size_t k = 0; k < count; ++k) value -= share[(g * size + i) * count + k] * shared[k];
      own[g * size + i] = value;
    }
  }
  return true;
}

}  // namespace lamina
