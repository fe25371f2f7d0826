// tests/stokes/test_inertia.cpp: flow with inertia against laws of mechanics and of weak inertia.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "stages/stokes/flow.h"
#include "stages/stokes/inertia.h"
#include "stages/stokes/operator.h"
#include "tests/pores/boxes.h"

namespace lamina {
namespace {

using stokes::Field;
using stokes::Four;

/// A box that repeats along all axes. solid  called with the place of a voxel's centre, in voxels
template <class Solid>
stokes::Grid grid_of(std::uint32_t nx, std::uint32_t ny, std::uint32_t nz, const Solid& solid) {
  const VoxelStack box = pores::testing::stack_of(
      pores::testing::Voxels(nx, ny, nz).fill([&](auto x, auto y, auto z) { return solid(x + 0.5, y + 0.5, z + 0.5); }),
      {true, true, true});
  return *stokes::make_grid(box, 4);
}

/// A wedge, which has another shape upstream than downstream, and a block to one side of it.
stokes::Grid lopsided() {
  return grid_of(24, 20, 1, [](double x, double y, double) {
    return (x > 4 && x < 14 && std::abs(y - 11) < 0.5 * (x - 4)) || (x < 3 && y < 4);
  });
}
stokes::Grid spheres(std::uint32_t side) {
  return grid_of(side, side, side, [=](double x, double y, double z) {
    const double half = side / 2.0;
    return std::hypot(x - half, y - half, z - half) < 0.42 * side || std::hypot(x, y - half, z) < 0.2 * side;
  });
}

stokes::InertialFlow flow_of(const stokes::Grid& grid, int axis, double inertia, double tolerance, Field& field) {
  stokes::InertiaOptions options;
  options.tolerance = tolerance;
  const Result<stokes::InertialFlow> flow = stokes::solve_with_inertia(grid, axis, inertia, options, field);
  EXPECT_TRUE(flow.ok() && flow->settled);
  return *flow;
}
double apparent(const stokes::Grid& grid, int axis, double inertia, double tolerance = 1e-5) {
  Field field = stokes::field_of(grid.cells);
  return flow_of(grid, axis, inertia, tolerance, field).permeability[static_cast<std::size_t>(axis)];
}

double product(const Four& x, const Four& y) { return double{x[0]} * y[0] + double{x[1]} * y[1] + double{x[2]} * y[2]; }

/// A force at all faces that lacks no mass.
Field convected(const stokes::Grid& grid, const Field& by, const Field& u, float factor) {
  const stokes::Convection convection(grid.cells);
  Field force = stokes::field_of(grid.cells);
  for (std::uint32_t i = 0; i < grid.cells.size(); ++i) force[i] = factor * convection.at(by, u, i);
  return force;
}
Field creeping(const stokes::Grid& grid, const Field* force) {
  Field field = stokes::field_of(grid.cells);
  stokes::FlowOptions options;
  options.tolerance = 1e-6;
  EXPECT_TRUE(stokes::solve(grid, 0, options, field, force).ok());
  return field;
}

/// Even where mass is not conserved.
TEST(Inertia, ConvectionTakesNoEnergy) {
  const stokes::Grid grid = spheres(12);
  const stokes::Operator stokes(grid.cells);
  std::mt19937 random(5);
  Field by = stokes::field_of(grid.cells), u = by;
  for (std::uint32_t i = 0; i < grid.cells.size(); ++i) {
    for (int a = 0; a < 3; ++a) {
      by[i][a] = stokes.exists(i)[a] * (static_cast<float>(random() % 2001) - 1000);
      u[i][a] = stokes.exists(i)[a] * (static_cast<float>(random() % 2001) - 1000);
    }
  }
  const Field force = convected(grid, by, u, 1);
  double sum = 0, all = 0;
  for (std::uint32_t i = 0; i < grid.cells.size(); ++i) {
    sum += product(u[i], force[i]);
    all += std::abs(product(u[i], force[i]));
  }
  EXPECT_GT(all, 0);
  EXPECT_LT(std::abs(sum), 1e-6 * all);
}

/// Vortices u = (sin x cos y, -cos x sin y), in each plane: (u . grad) u = (sin 2x, sin 2y) / 2, with an error of second order.
/// Where each cell of a box without solid lies, found by going from neighbour to neighbour.
std::vector<std::array<std::uint32_t, 3>> positions_of(const stokes::Cells& cells) {
  std::vector<std::array<std::uint32_t, 3>> position(cells.size(), {UINT32_MAX, 0, 0});
  std::vector<std::uint32_t> waiting{0};
  position[0] = {0, 0, 0};
  while (!waiting.empty()) {
    const std::uint32_t i = waiting.back();
    waiting.pop_back();
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t ahead = cells.neighbour[i][2 * a + 1];
      if (position[ahead][0] != UINT32_MAX) continue;
      position[ahead] = position[i];
      position[ahead][a] = (position[i][a] + 1) % cells.box[a];
      waiting.push_back(ahead);
    }
  }
  return position;
}

TEST(Inertia, ConvectionIsThatOfVortices) {
  for (int a = 0; a < 3; ++a) {
    std::array<double, 2> worst{};
    for (const std::uint32_t n : {16u, 32u}) {
      const stokes::Grid grid = grid_of(n, n, n, [](double, double, double) { return false; });
      const int b = (a + 1) % 3;
      const double k = 2 * std::numbers::pi / n;
      Field u = stokes::field_of(grid.cells);
      const auto positions = positions_of(grid.cells);
      const auto position = [&](std::uint32_t i, int axis) { return positions[i][static_cast<std::size_t>(axis)]; };
      for (std::uint32_t i = 0; i < grid.cells.size(); ++i) {
        const double x = k * position(i, a), y = k * position(i, b);  // of the cell's middle; faces are half a voxel further
        u[i][a] = static_cast<float>(std::sin(x + k / 2) * std::cos(y));
        u[i][b] = static_cast<float>(-std::cos(x) * std::sin(y + k / 2));
      }
      const Field force = convected(grid, u, u, 1);
      for (std::uint32_t i = 0; i < grid.cells.size(); ++i) {
        for (const int axis : {a, b}) {
          const double by_hand = k * 0.5 * std::sin(2 * k * (position(i, axis) + 0.5));
          worst[n == 32 ? 1 : 0] = std::max(worst[n == 32 ? 1 : 0], std::abs(double{force[i][axis]} - by_hand) / k);
        }
      }
    }
    EXPECT_LT(worst[0], 0.05);
    EXPECT_NEAR(worst[0] / worst[1], 4, 0.4) << a;
  }
}

TEST(Inertia, StraightPoresFeelNone) {
  const stokes::Grid slit = grid_of(3, 12, 1, [](double, double y, double) { return y < 1 || y > 11; });
  const stokes::Grid tube = grid_of(14, 14, 3, [](double x, double y, double) { return std::hypot(x - 7, y - 7) > 6.5; });
  EXPECT_NEAR(apparent(slit, 0, 10) / apparent(slit, 0, 0), 1, 1e-5);
  EXPECT_NEAR(apparent(tube, 2, 10) / apparent(tube, 2, 0), 1, 1e-5);
}

/// What the force does, viscosity takes: u . (-div grad u), and nothing goes into convection.
TEST(Inertia, WhatTheForceDoesIsDissipated) {
  const stokes::Grid grid = spheres(16);
  const stokes::Operator stokes(grid.cells);
  Field field = stokes::field_of(grid.cells);
  const stokes::InertialFlow flow = flow_of(grid, 0, 1, 1e-5, field);
  EXPECT_LT(flow.permeability[0], 0.93 * apparent(grid, 0, 0)) << "inertia must matter here";
  Field velocity = field;
  for (Four& cell : velocity) cell[3] = 0;
  double dissipated = 0;
  for (std::uint32_t i = 0; i < grid.cells.size(); ++i) dissipated += product(velocity[i], stokes.at(velocity, i));
  EXPECT_NEAR(dissipated / static_cast<double>(grid.cells.voxels()) / flow.permeability[0], 1, 1e-4);
}

/// The mean velocity lacks a term of first order in inertia, for any shape of pores; that of second order follows from
/// two creeping flows, by reciprocity (C. C. Mei, J.-L. Auriault, "The effect of weak inertia on flow through a porous medium",
/// J. Fluid Mech. 222 (1991), section 3). So does it for flow the other way; only terms of higher order differ by direction.
TEST(Inertia, WeakInertiaGoesWithTheCubeOfVelocity) {
  const stokes::Grid grid = lopsided();
  const Field u0 = creeping(grid, nullptr), force1 = convected(grid, u0, u0, -1), u1 = creeping(grid, &force1);
  const Field one = convected(grid, u0, u1, -1), other = convected(grid, u1, u0, -1);
  double first = 0, second = 0, k = 0;
  for (std::uint32_t i = 0; i < grid.cells.size(); ++i) {
    first += u1[i][0];
    second += product(u0[i], one[i] + other[i]);
    k += u0[i][0];
  }
  EXPECT_LT(second, 0);
  EXPECT_LT(std::abs(first), 1e-4 * std::sqrt(-second * k));
  const double weak = std::sqrt(0.01 * k / -second);  // inertia that takes 1 %
  const auto loss = [&](double inertia) {
    return 1 - apparent(grid, 0, inertia) / (k / static_cast<double>(grid.cells.voxels()));
  };
  const double there = loss(weak), back = loss(-weak);
  EXPECT_NEAR((there + back) / 2, 0.01, 5e-4);
  EXPECT_NEAR(loss(weak / 2), 0.0025, 6e-5);
  EXPECT_LT(std::abs(there - back), 1e-3);
  EXPECT_GT(std::abs(loss(12 * weak) - loss(-12 * weak)), 5e-3) << "strong inertia distinguishes the directions";
}

TEST(Inertia, IsTheSameForAnyThreads) {
  const stokes::Grid grid = spheres(14);
  std::vector<stokes::InertialFlow> found;
  for (const std::size_t threads : {1u, 4u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    Field field = stokes::field_of(grid.cells);
    found.push_back(flow_of(grid, 2, 1, 1e-3, field));
  }
  EXPECT_EQ(found[0].permeability, found[1].permeability);
  EXPECT_EQ(found[0].steps, found[1].steps);
}

TEST(Inertia, SweepsToTheVelocityWanted) {
  const stokes::Grid grid = lopsided();
  stokes::InertiaOptions options;
  options.tolerance = 1e-3;
  const auto points = stokes::sweep(grid, 0, 2, 4, options);
  ASSERT_TRUE(points.ok());
  ASSERT_EQ(points->size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR((*points)[i].velocity, 0.5 * static_cast<double>(i + 1), 0.1);
    EXPECT_GT((*points)[i].excess, i == 0 ? 0 : (*points)[i - 1].excess);
  }
  EXPECT_NEAR(apparent(grid, 0, points->back().force, 1e-4), points->back().velocity / points->back().force,
              3e-3 * points->back().velocity / points->back().force);
  options.max_rounds = 1;
  const auto cut = stokes::sweep(grid, 0, 400, 4, options);
  ASSERT_TRUE(cut.ok());
  ASSERT_FALSE(cut->empty());
  EXPECT_FALSE(cut->back().settled);
  options.progress = [](std::uint32_t, double) { return false; };
  EXPECT_EQ(stokes::sweep(grid, 0, 4, 4, options).error().fault, Fault::kInterrupted);
}

TEST(Inertia, IsWeakWhileTheExcessGoesWithTheSquare) {
  std::vector<stokes::SweepPoint> points;
  for (int i = 1; i <= 6; ++i) points.push_back({1.0 * i, 1.0 * i, i <= 3 ? 0.01 * i * i : 0.03 * i, true});
  EXPECT_EQ(stokes::weak_up_to(points), 3);
  EXPECT_EQ(stokes::weak_up_to({}), 0);
}

}  // namespace
}  // namespace lamina
