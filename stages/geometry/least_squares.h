// stages/geometry/least_squares.h: small dense problems of linear least squares.
//
// Rows are summed into normal equations as they come, so memory depends on the number of unknowns only. That squares the
// condition number: columns may differ in length by any factor, but should not be closer to dependent than about 1e-6.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace lamina {

/// The x that minimises the sum of weight * (value - row . x)^2.
class LeastSquares {
 public:
  explicit LeastSquares(std::size_t unknowns) : right_(unknowns, 0), square_(unknowns * unknowns, 0) {}

  /// row     one factor for each unknown. cost  O(unknowns^2)
  /// weight  >= 0
  void add(std::span<const double> row, double value, double weight = 1);

  /// Adds rows that keep unknowns near 0 (Tikhonov): relative, absolute  added to the squared length of each column, the first
  /// as a share of it.
  void damp(double relative, double absolute);

  /// An unknown whose column is 0 becomes 0.
  /// x        one number for each unknown
  /// returns  false, with x as it was, where columns depend on each other (1e-13 of their squares is left of one without the
  ///          others) or a number is not finite. damp() prevents the first. cost  O(unknowns^3)
  bool solve(std::span<double> x) const;

 private:
  friend class GroupedLeastSquares;
  double& at(std::size_t row, std::size_t column) { return square_[row * right_.size() + column]; }

  std::vector<double> right_, square_;  // square_ by rows; only its lower triangle is kept
};

/// The same with two kinds of unknowns: those that all rows share, and groups of which each row has one. Groups are eliminated
/// (Schur complement), so that cost and memory grow linearly with their number.
class GroupedLeastSquares {
 public:
  struct Term {
    std::size_t unknown;
    double factor;
  };
  /// own  unknowns of each group
  GroupedLeastSquares(std::size_t shared, std::size_t groups, std::size_t own);

  /// shared  the factors that are not 0, each unknown once; own  one factor for each unknown of the group
  /// cost    O((terms + own)^2)
  void add(std::span<const Term> shared, std::size_t group, std::span<const double> own, double value, double weight = 1);

  /// shared, own  out, own by groups. Every group needs rows that determine it.
  /// returns      as LeastSquares::solve(), relative  is as of damp(), of shared unknowns after groups are eliminated
  /// cost         O(groups * shared^2 + shared^3)
  bool solve(double relative, std::span<double> shared, std::span<double> own) const;

 private:
  LeastSquares shared_;
  std::vector<LeastSquares> group_;
  std::vector<double> mixed_;  // by groups, own unknowns, shared ones
};

}  // namespace lamina
