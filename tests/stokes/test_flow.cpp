// tests/stokes/test_flow.cpp: creeping flow against solutions by hand and published ones.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "stages/stokes/flow.h"
#include "tests/pores/boxes.h"
#include "tests/stokes/flow_through.h"

namespace lamina {
namespace {

/// A box that repeats along all axes. solid  called with the place of a voxel's centre, in voxels
template <class Solid>
VoxelStack box_of(std::uint32_t nx, std::uint32_t ny, std::uint32_t nz, const Solid& solid) {
  return pores::testing::stack_of(
      pores::testing::Voxels(nx, ny, nz).fill([&](auto x, auto y, auto z) { return solid(x + 0.5, y + 0.5, z + 0.5); }),
      {true, true, true});
}

using test::flow_through;

/// k = W^2 / 12 of the slit; the differences of second order are 2 / W^2 above it, which two grids show.
TEST(Flow, SlitsFollowTheCubicLaw) {
  for (const std::uint32_t width : {8u, 16u, 48u}) {
    const VoxelStack box = box_of(1, width + 2, 1, [&](double, double y, double) { return y < 1 || y > width + 1; });
    const double by_hand = width * width / 12.0 * width / (width + 2);
    const double found = flow_through(box, 0).permeability[0] / by_hand;
    EXPECT_NEAR(found, 1 + 2.0 / (width * width), 2e-4) << width;
    EXPECT_NEAR(found, 1, width == 48 ? 1e-3 : 4e-2);
    EXPECT_NEAR(flow_through(box, 1).permeability[1], 0, 1e-5 * by_hand) << "across the slit nothing flows";
  }
}

TEST(Flow, ATubeFollowsHagenAndPoiseuille) {
  const double radius = 64, side = 130;
  const VoxelStack box =
      box_of(130, 130, 1, [&](double x, double y, double) { return std::hypot(x - side / 2, y - side / 2) > radius; });
  const double by_hand = std::numbers::pi * std::pow(radius, 4) / 8 / (side * side);
  EXPECT_NEAR(flow_through(box, 2).permeability[2] / by_hand, 1, 1e-3);
}

/// Square arrays of cylinders, flow across: drag per length and velocity by share of the area (A. S. Sangani, A. Acrivos, "Slow
/// flow past periodic arrays of cylinders with application to heat transfer", Int. J. Multiphase Flow 8 (1982), table 1).
TEST(Flow, AcrossCylindersIsAsPublished) {
  for (const auto& [share, drag] : {std::pair{0.1, 24.83}, {0.3, 102.90}, {0.5, 532.55}}) {
    const double side = 160, radius = side * std::sqrt(share / std::numbers::pi);
    const VoxelStack box = box_of(
        160, 160, 1, [&](double x, double y, double) { return std::hypot(x - side / 2 + 0.19, y - side / 2 + 0.37) < radius; });
    EXPECT_NEAR(side * side / flow_through(box, 0).permeability[0] / drag, 1, 0.01) << share;
  }
}

/// Drag of a sphere in simple cubic arrays, 6 pi mu a K U, by share of the volume (A. A. Zick, G. M. Homsy, "Stokes flow
/// through periodic arrays of spheres", J. Fluid Mech. 115 (1982), table 2); the last ones touch.
double drag_of_spheres(double share, std::uint32_t side) {
  const double radius = std::cbrt(3 * share / (4 * std::numbers::pi)), half = side / 2.0;
  const VoxelStack box = box_of(side, side, side, [&](double x, double y, double z) {
    return std::hypot(x - half + 0.19, y - half + 0.37, z - half + 0.41) < radius * side;
  });
  return side * side / (6 * std::numbers::pi * radius * flow_through(box, 2, 1e-4).permeability[2]);
}
TEST(Flow, PastSpheresIsAsPublished) {
  for (const auto& [share, drag] : {std::pair{0.125, 4.292}, {0.343, 15.4}, {0.5236, 42.1}})
    EXPECT_NEAR(drag_of_spheres(share, 48) / drag, 1, 0.02) << share;
}

/// Random blobs: no symmetry helps.
VoxelStack blobs(std::uint32_t side, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::array<double, 4>> ball(24);
  const auto some = [&] { return static_cast<double>(random() % 1000) * 1e-3; };
  for (auto& [x, y, z, radius] : ball)
    x = some() * side, y = some() * side, z = some() * side, radius = side * (0.1 + 0.1 * some());
  const auto near = [&](double a, double b) { return std::abs(std::remainder(a - b, static_cast<double>(side))); };
  return box_of(side, side, side, [&](double x, double y, double z) {
    for (const auto& b : ball)
      if (std::hypot(near(x, b[0]), near(y, b[1]), near(z, b[2])) < b[3]) return true;
    return false;
  });
}

TEST(Flow, TheTensorIsSymmetric) {
  const VoxelStack box = blobs(20, 7);
  std::array<std::array<double, 3>, 3> k{};
  for (int a = 0; a < 3; ++a) k[static_cast<std::size_t>(a)] = flow_through(box, a).permeability;
  for (const auto& [a, b] : {std::pair{0u, 1u}, {1u, 2u}, {0u, 2u}}) {
    EXPECT_GT(std::min(k[a][a], k[b][b]), 0);
    EXPECT_NEAR(k[a][b], k[b][a], 1e-4 * k[a][a]);
  }
}

TEST(Flow, TurnedAndScaledBoxesGiveTheSame) {
  const VoxelStack box = blobs(16, 3);
  const auto solid = [&](double x, double y, double z) {
    bool in = false;
    for (const std::uint32_t c : box.view().row(static_cast<std::uint32_t>(y), static_cast<std::uint32_t>(z))) in ^= c <= x;
    return in;
  };
  const VoxelStack turned = box_of(16, 16, 16, [&](double x, double y, double z) { return solid(y, z, x); });
  const double k = flow_through(box, 0).permeability[0];
  EXPECT_NEAR(flow_through(turned, 1).permeability[1] / k, 1, 1e-4);
  VoxelStack large = box;
  large.edge = {7000, 7000, 7000};  // the unit is the edge
  EXPECT_EQ(flow_through(large, 0).permeability[0], k);
  // Voxels half as long along z, twice as many: the same body, up to what the finer grid sees better.
  VoxelStack fine = box_of(1, 10, 2, [](double, double y, double) { return y < 1 || y > 9; });
  fine.edge = {1000, 1000, 500};
  EXPECT_NEAR(flow_through(fine, 0).permeability[0], 4 * 8 * 8 / 12.0 * 0.8 * (1 + 2.0 / 64), 2e-3);
}

TEST(Flow, IsTheSameForAnyThreadsAndNumberOfLevels) {
  const VoxelStack box = blobs(24, 11);
  std::vector<stokes::Flow> found;
  for (const std::size_t threads : {1u, 3u, 7u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    found.push_back(flow_through(box, 2));
  }
  EXPECT_EQ(found[0].permeability, found[1].permeability);
  EXPECT_EQ(found[0].permeability, found[2].permeability);
  EXPECT_EQ(found[0].steps, found[2].steps);
  EXPECT_NEAR(flow_through(box, 2, 1e-5, 0).permeability[2] / found[0].permeability[2], 1, 1e-4);
}

/// Walls close the ends of axes that do not repeat; closed hollows do not flow.
TEST(Flow, EndsOfTheBoxAndHollowsAreClosed) {
  VoxelStack box = box_of(10, 12, 6, [](double, double y, double) { return y < 1 || y > 11; });
  box.periodic = {false, true, true};
  EXPECT_NEAR(flow_through(box, 1).permeability[1], 0, 1e-5);
  EXPECT_NEAR(flow_through(box, 0).permeability[0], 0, 1e-5);
  EXPECT_GT(flow_through(box, 2).permeability[2], 1);
  const VoxelStack full = box_of(4, 4, 4, [](double, double, double) { return true; });
  const Result<stokes::Grid> none = stokes::make_grid(full, 3);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().message, "there is no void for a fluid");
}

TEST(Flow, StopsOnRequest) {
  const VoxelStack box = blobs(16, 3);
  const Result<stokes::Grid> grid = stokes::make_grid(box, 3);
  stokes::Field field = stokes::field_of(grid->cells);
  stokes::FlowOptions options;
  options.progress = [](std::uint32_t step, double) { return step < 5; };
  const Result<stokes::Flow> flow = stokes::solve(*grid, 0, options, field);
  ASSERT_FALSE(flow.ok());
  EXPECT_EQ(flow.error().fault, Fault::kInterrupted);
}

}  // namespace
}  // namespace lamina
