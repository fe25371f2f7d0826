// Laws of least squares: what is left over is orthogonal to the columns, what can be met is met, and what rows do not determine
// is treated as documented.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>
#include <vector>

#include "stages/geometry/least_squares.h"

namespace lamina::test {
namespace {

struct Row {
  std::vector<double> factor;
  double value, weight;
};

std::vector<Row> random_rows(std::mt19937& random, std::size_t count, std::size_t unknowns) {
  std::normal_distribution<double> pick;
  std::vector<Row> rows(count);
  for (Row& row : rows) {
    row = {std::vector<double>(unknowns), pick(random), std::abs(pick(random))};
    // Columns of very different lengths.
    for (std::size_t i = 0; i < unknowns; ++i) row.factor[i] = pick(random) * std::pow(10, 3 * static_cast<double>(i) - 4);
  }
  return rows;
}

double rest_of(const Row& row, std::span<const double> x) {
  double rest = row.value;
  for (std::size_t i = 0; i < x.size(); ++i) rest -= row.factor[i] * x[i];
  return rest;
}

TEST(LeastSquares, WhatIsLeftIsOrthogonalToEveryColumn) {
  std::mt19937 random(7);
  for (std::size_t unknowns = 1; unknowns <= 6; ++unknowns) {
    const std::vector<Row> rows = random_rows(random, 40, unknowns);
    LeastSquares linear(unknowns);
    for (const Row& row : rows) linear.add(row.factor, row.value, row.weight);
    std::vector<double> x(unknowns);
    ASSERT_TRUE(linear.solve(x));
    for (std::size_t i = 0; i < unknowns; ++i) {
      double product = 0, length = 0;
      for (const Row& row : rows) {
        product += row.weight * row.factor[i] * rest_of(row, x);
        length += row.weight * row.factor[i] * row.factor[i];
      }
      EXPECT_LT(std::abs(product), 1e-11 * std::sqrt(length) * 40) << i << " of " << unknowns;
    }
  }
}

TEST(LeastSquares, PolynomialsComeBackFromTheirValues) {
  const std::array<double, 5> polynomial{3, -2, 0.5, 7, -1.25};
  LeastSquares linear(polynomial.size());
  for (int k = -10; k <= 10; ++k) {
    std::array<double, 5> powers{1};
    for (std::size_t i = 1; i < powers.size(); ++i) powers[i] = powers[i - 1] * 0.1 * k;
    double value = 0;
    for (std::size_t i = 0; i < powers.size(); ++i) value += polynomial[i] * powers[i];
    linear.add(powers, value, 1 + k * k);
  }
  std::array<double, 5> found{};
  ASSERT_TRUE(linear.solve(found));
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_NEAR(found[i], polynomial[i], 1e-10);
}

TEST(LeastSquares, AColumnOfZerosIsZeroAndDependentColumnsAreRefusedUntilDamped) {
  std::mt19937 random(8);
  std::normal_distribution<double> pick;
  LeastSquares zero(3), dependent(3);
  for (int k = 0; k < 20; ++k) {
    const double a = pick(random), b = pick(random);
    zero.add(std::array{a, 0.0, b}, 2 * a - 3 * b);
    dependent.add(std::array{a, b, a + b}, 2 * a + b);
  }
  std::array<double, 3> x{9, 9, 9};
  ASSERT_TRUE(zero.solve(x));
  EXPECT_NEAR(x[0], 2, 1e-12);
  EXPECT_EQ(x[1], 0);
  EXPECT_NEAR(x[2], -3, 1e-12);
  x = {9, 9, 9};
  EXPECT_FALSE(dependent.solve(x));
  EXPECT_EQ(x, (std::array<double, 3>{9, 9, 9}));
  dependent.damp(1e-9, 0);
  ASSERT_TRUE(dependent.solve(x));
  EXPECT_NEAR(x[0] + x[2], 2, 1e-6);
  EXPECT_NEAR(x[1] + x[2], 1, 1e-6);
}

TEST(LeastSquares, NumbersThatAreNotFiniteAreRefused) {
  LeastSquares linear(2);
  linear.add(std::array{1.0, 2.0}, std::nan(""));
  linear.add(std::array{2.0, 1.0}, 1);
  std::array<double, 2> x{5, 6};
  EXPECT_FALSE(linear.solve(x));
  EXPECT_EQ(x[0], 5);
  LeastSquares factors(1);
  factors.add(std::array<double, 1>{INFINITY}, 1);
  EXPECT_FALSE(factors.solve(std::span(x).first(1)));
}

TEST(LeastSquares, DampingIsRowsThatKeepUnknownsSmall) {
  std::mt19937 random(9);
  LeastSquares damped(2), rows(2);
  for (const Row& row : random_rows(random, 10, 2)) {
    damped.add(row.factor, row.value);
    rows.add(row.factor, row.value);
  }
  damped.damp(0, 0.25);
  rows.add(std::array{0.5, 0.0}, 0);
  rows.add(std::array{0.0, 0.5}, 0);
  std::array<double, 2> one{}, other{};
  ASSERT_TRUE(damped.solve(one) && rows.solve(other));
  EXPECT_NEAR(one[0], other[0], 1e-12);
  EXPECT_NEAR(one[1], other[1], 1e-12);
}

TEST(GroupedLeastSquares, IsTheProblemOfAllUnknownsTogether) {
  constexpr std::size_t kShared = 4, kGroups = 5, kOwn = 2, kAll = kShared + kGroups * kOwn;
  std::mt19937 random(10);
  std::normal_distribution<double> pick;
  GroupedLeastSquares grouped(kShared, kGroups, kOwn);
  LeastSquares together(kAll);
  for (std::size_t k = 0; k < 100; ++k) {
    const std::size_t group = k % kGroups;
    std::array<double, kAll> row{};
    std::vector<GroupedLeastSquares::Term> terms;
    std::array<double, kOwn> own{};
    // In any order, and not all of them.
    for (const std::size_t unknown : {k % kShared, (k + 3) % kShared, (k + 1) % kShared}) {
      terms.push_back({unknown, pick(random)});
      row[unknown] = terms.back().factor;
    }
    for (std::size_t i = 0; i < kOwn; ++i) row[kShared + group * kOwn + i] = own[i] = pick(random);
    const double value = pick(random), weight = std::abs(pick(random));
    grouped.add(terms, group, own, value, weight);
    together.add(row, value, weight);
  }
  std::array<double, kAll> expected{};
  std::array<double, kShared> shared{};
  std::array<double, kGroups * kOwn> own{};
  ASSERT_TRUE(together.solve(expected));
  ASSERT_TRUE(grouped.solve(0, shared, own));
  for (std::size_t i = 0; i < kShared; ++i) EXPECT_NEAR(shared[i], expected[i], 1e-11);
  for (std::size_t i = 0; i < own.size(); ++i) EXPECT_NEAR(own[i], expected[kShared + i], 1e-11);
}

TEST(GroupedLeastSquares, AGroupThatItsRowsDoNotDetermineIsRefused) {
  GroupedLeastSquares grouped(1, 2, 2);
  grouped.add(std::array{GroupedLeastSquares::Term{0, 1.0}}, 0, std::array{1.0, 1.0}, 1);
  grouped.add({}, 0, std::array{2.0, 2.0}, 1);
  std::array<double, 1> shared{};
  std::array<double, 4> own{};
  EXPECT_FALSE(grouped.solve(0, shared, own));
}

}  // namespace
}  // namespace lamina::test
