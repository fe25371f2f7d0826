// tests/stokes/test_turned_plans.cpp: a plan at 30 degrees has the permeability of the one at 0 degrees, turned.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/pores/boxes.h"
#include "tests/stokes/flow_through.h"

namespace lamina {
namespace {

/// A rectangular lattice a by sqrt(3) a has a rectangular period 2 sqrt(3) a by 2 a at just 30 degrees; in whole voxels 97 by
/// 56 do, whose ratio is sqrt(3) within 1e-5. a, in voxels of the flow:
constexpr double kApart = 28;
constexpr std::uint32_t kLong = 97, kShort = 56, kCut = 3;

using PlaneTensor = std::array<std::array<double, 3>, 3>;

/// solid  called with the places along the lattice's short and long side, from a point of it, and the height
template <class Solid>
PlaneTensor plan_tensor(bool turned, std::uint32_t high, double tolerance, const Solid& solid) {
  const double angle = turned ? std::numbers::pi / 6 : 0, c = std::cos(angle), s = std::sin(angle);
  const std::uint32_t nx = turned ? kLong : kShort, ny = turned ? kShort : kLong;
  const VoxelStack box =
      pores::testing::stack_of(pores::testing::Voxels(kCut * nx, kCut * ny, kCut * high).fill([&](auto i, auto j, auto k) {
        const double x = (i + 0.5) / kCut + 0.19, y = (j + 0.5) / kCut + 0.37;
        return solid(std::remainder(c * x + s * y, kApart), std::remainder(c * y - s * x, kLong / 2.0), (k + 0.5) / kCut);
      }),
                               {true, true, true});
  PlaneTensor k{};
  for (int axis = 0; axis < 3; ++axis)
    k[static_cast<std::size_t>(axis)] = test::flow_through(box, axis, tolerance, 6, kCut).permeability;
  return k;
}

/// R k R^T, R turns by 30 degrees about z.
PlaneTensor by_thirty_degrees(const PlaneTensor& k) {
  const double c = std::sqrt(0.75), s = 0.5;
  const PlaneTensor r{{{c, -s, 0}, {s, c, 0}, {0, 0, 1}}};
  PlaneTensor turned{};
  for (std::size_t i = 0; i < 9; ++i)
    for (std::size_t j = 0; j < 9; ++j) turned[i / 3][j / 3] += r[i / 3][i % 3] * k[i % 3][j % 3] * r[j / 3][j % 3];
  return turned;
}

/// within  of the largest permeability in the plane; of that along z by itself
void expect_alike(const PlaneTensor& found, const PlaneTensor& wanted, double within) {
  const double largest = std::max(wanted[0][0], wanted[1][1]);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b)
      EXPECT_NEAR(found[a][b], wanted[a][b], within * (a == 2 && b == 2 ? wanted[2][2] : largest)) << a << b;
}

TEST(TurnedPlans, CylindersAtThirtyDegreesHaveTheTensorTurned) {
  const auto cylinder = [](double u, double v, double) { return std::hypot(u, v) < 9; };
  const PlaneTensor straight = plan_tensor(false, 1, 1e-4, cylinder), turned = plan_tensor(true, 1, 1e-4, cylinder);
  EXPECT_GT(straight[0][0], 5 * straight[1][1]) << "else a turn says little";
  expect_alike(turned, by_thirty_degrees(straight), 0.01);
}

/// Two layers, lines across each other as far apart as the lattice has it; beads are ellipses that overlap those below by a
/// fifth of a voxel.
TEST(TurnedPlans, CrossedLinesAtThirtyDegreesHaveTheTensorTurned) {
  const auto beads = [](double u, double v, double z) {
    return std::hypot((z < 10 ? u : v) / 9.4, (std::fmod(z, 10) - 5) / 5.1) < 1;
  };
  const PlaneTensor straight = plan_tensor(false, 20, 5e-4, beads), turned = plan_tensor(true, 20, 5e-4, beads);
  EXPECT_GT(std::abs(straight[1][1] / straight[0][0] - 1), 0.2) << "else a turn says little";
  expect_alike(turned, by_thirty_degrees(straight), 0.03);
}

}  // namespace
}  // namespace lamina
