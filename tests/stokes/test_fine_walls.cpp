// tests/stokes/test_fine_walls.cpp: creeping flow between walls given by a raster three times finer than the flow's voxels.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "stages/stokes/flow.h"
#include "tests/pores/boxes.h"
#include "tests/stokes/flow_through.h"

namespace lamina {
namespace {

constexpr std::uint32_t kFiner = 3;

/// A box that repeats along all axes. solid  called with the place of a fine voxel's centre, in voxels of the flow
template <class Solid>
VoxelStack fine_box_of(std::uint32_t nx, std::uint32_t ny, std::uint32_t nz, const Solid& solid) {
  const auto middle = [](std::uint32_t i) { return (i + 0.5) / kFiner; };
  return pores::testing::stack_of(
      pores::testing::Voxels(kFiner * nx, kFiner * ny, kFiner * nz).fill([&](auto x, auto y, auto z) {
        return solid(middle(x), middle(y), middle(z));
      }),
      {true, true, true});
}

stokes::Flow fine_flow_through(const VoxelView& fine, int axis, double tolerance = 1e-5) {
  return test::flow_through(fine, axis, tolerance, 5, kFiner);
}

/// Walls at thirds of voxels: W^3 / 12 in all, up to the differences of second order.
TEST(FineWalls, SlitsFollowTheCubicLawWhereverTheirWallsAre) {
  for (const double width : {8.0, 8 + 1 / 3.0, 8 + 2 / 3.0, 9.0}) {
    for (const double low : {1.0, 1 + 1 / 3.0, 1 + 2 / 3.0}) {
      const VoxelStack box = fine_box_of(1, 11, 1, [&](double, double y, double) { return y < low || y > low + width; });
      EXPECT_NEAR(fine_flow_through(box, 0).permeability[0] / (width * width * width / 12 / 11), 1, 2.5 / (width * width))
          << width << " from " << low;
    }
  }
}

TEST(FineWalls, ATubeFollowsHagenAndPoiseuille) {
  const double radius = 15.7, side = 34;
  const VoxelStack box = fine_box_of(
      34, 34, 1, [&](double x, double y, double) { return std::hypot(x - side / 2 + 0.19, y - side / 2 + 0.37) > radius; });
  EXPECT_NEAR(fine_flow_through(box, 2).permeability[2] / (std::numbers::pi * std::pow(radius, 4) / 8 / (side * side)), 1,
              0.01);
}

/// Planes of normal (3, 4) / 5, 24 voxels apart: the flow follows them, as the cubic law has it, whichever way it is pushed.
TEST(FineWalls, SlantedSlitsLeadAlongTheirWalls) {
  const double apart = 24, width = 14.4;
  const VoxelStack box = fine_box_of(120, 120, 1, [&](double x, double y, double) {
    return std::abs(std::remainder((3 * x + 4 * y) / 5 + 0.1, apart)) > width / 2;
  });
  const double by_hand = width * width * width / 12 / apart;
  const std::array<double, 3> along_x = fine_flow_through(box, 0, 1e-4).permeability;
  EXPECT_NEAR(along_x[0] / (by_hand * 16 / 25), 1, 0.02);
  EXPECT_NEAR(along_x[1] / (by_hand * -12 / 25), 1, 0.02);
}

/// Hexagonal arrays lead alike along all directions of their plane; x and y differ for them by a turn of 30 degrees.
TEST(FineWalls, AHexagonalArrayTurnedByThirtyDegreesIsTheSame) {
  const double radius = 22;
  const VoxelStack box = fine_box_of(97, 56, 1, [&](double x, double y, double) {
    const auto within = [&](double cx, double cy) {
      return std::hypot(std::remainder(x - cx, 97.0), std::remainder(y - cy, 56.0)) < radius;
    };
    return within(0.19, 0.37) || within(0.19 + 48.5, 0.37 + 28);
  });
  EXPECT_NEAR(fine_flow_through(box, 0, 1e-4).permeability[0] / fine_flow_through(box, 1, 1e-4).permeability[1], 1, 0.01);
}

/// Drag of a sphere, 6 pi mu a K U (A. A. Zick, G. M. Homsy, "Stokes flow through periodic arrays of spheres", J. Fluid Mech.
/// 115 (1982), table 2). centres  in sides of the cell
double drag_of_spheres(const std::vector<std::array<double, 3>>& centres, double share, std::uint32_t side) {
  const double count = static_cast<double>(centres.size()), radius = std::cbrt(3 * share / (4 * std::numbers::pi * count));
  const VoxelStack box = fine_box_of(side, side, side, [&](double x, double y, double z) {
    for (const auto& c : centres) {
      const double dx = std::remainder((x + 0.19) / side - c[0], 1.0), dy = std::remainder((y + 0.37) / side - c[1], 1.0),
                   dz = std::remainder((z + 0.41) / side - c[2], 1.0);
      if (dx * dx + dy * dy + dz * dz < radius * radius) return true;
    }
    return false;
  });
  return side * side / (6 * std::numbers::pi * radius * count * fine_flow_through(box, 2, 1e-4).permeability[2]);
}
const std::vector<std::array<double, 3>> kSimple = {{0, 0, 0}}, kBody = {{0, 0, 0}, {0.5, 0.5, 0.5}},
                                         kFace = {{0, 0, 0}, {0.5, 0.5, 0}, {0.5, 0, 0.5}, {0, 0.5, 0.5}};

TEST(FineWalls, TouchingSpheresAreAsPublishedWithinTheErrorThatIsReported) {
  struct Published {
    std::vector<std::array<double, 3>> centres;
    double share, drag;
    std::uint32_t side;
    double within;
  };
  for (const Published& array :
       {Published{kSimple, 0.5236, 42.1, 32, 0.01}, {kBody, 0.6802, 162.9, 32, 0.02}, {kFace, 0.7405, 435, 48, 0.01}}) {
    const double count = static_cast<double>(array.centres.size());
    const double off = drag_of_spheres(array.centres, array.share, array.side) / array.drag - 1;
    const double radius = std::cbrt(3 * array.share / (4 * std::numbers::pi * count));
    EXPECT_NEAR(off, 0, array.within) << count;
    const double surface = 4 * std::numbers::pi * radius * radius * count / array.side;
    EXPECT_LT(std::abs(off), stokes::error_floor(1 - array.share, surface, kFiner)) << count;
  }
  EXPECT_EQ(stokes::error_floor(0, 0.1, kFiner), 1) << "nothing is known of what does not flow";
  EXPECT_EQ(stokes::error_floor(1, 0, kFiner), 0);
}

TEST(FineWalls, AFilmThinnerThanAVoxelIsTight) {
  const double low = 10 + 1 / 3.0, high = 10 + 2 / 3.0;
  const VoxelStack slits =
      fine_box_of(1, 20, 1, [&](double, double y, double) { return y < 2 || (y > low && y < high) || y > 18; });
  const double by_hand = (std::pow(low - 2, 3) + std::pow(18 - high, 3)) / 12 / 20;
  EXPECT_NEAR(fine_flow_through(slits, 0).permeability[0] / by_hand, 1, 2.5 / 50);
  const VoxelStack across = fine_box_of(1, 20, 1, [&](double, double y, double) { return y > low && y < high; });
  EXPECT_NEAR(fine_flow_through(across, 1).permeability[1], 0, 1e-3);
}

VoxelStack balls(std::uint32_t side, const std::array<int, 3>& order = {0, 1, 2}) {
  return fine_box_of(side, side, side, [&](double x, double y, double z) {
    const std::array<double, 3> at = {x, y, z};
    const double u = at[order[0]], v = at[order[1]], w = at[order[2]], s = side;
    const auto within = [&](double cu, double cv, double cw, double radius) {
      return std::hypot(std::remainder(u - cu * s, s), std::remainder(v - cv * s, s), std::remainder(w - cw * s, s)) <
             radius * s;
    };
    return within(0.1, 0.2, 0.3, 0.31) || within(0.6, 0.55, 0.2, 0.27) || within(0.3, 0.7, 0.75, 0.29) ||
           within(0.8, 0.1, 0.7, 0.2);
  });
}

TEST(FineWalls, TheTensorIsSymmetricAndTurnsWithTheBox) {
  const VoxelStack box = balls(20), turned = balls(20, {1, 2, 0});
  std::array<std::array<double, 3>, 3> k{};
  for (int a = 0; a < 3; ++a) k[static_cast<std::size_t>(a)] = fine_flow_through(box, a).permeability;
  for (const auto& [a, b] : {std::pair{0u, 1u}, {1u, 2u}, {0u, 2u}}) EXPECT_NEAR(k[a][b], k[b][a], 1e-3 * k[a][a]);
  EXPECT_NEAR(fine_flow_through(turned, 1).permeability[1] / k[0][0], 1, 1e-4);
}

TEST(FineWalls, AreTheSameForAnyThreads) {
  const VoxelStack box = balls(18);
  std::vector<stokes::Flow> found;
  for (const std::size_t threads : {1u, 3u}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    found.push_back(fine_flow_through(box, 2));
  }
  EXPECT_EQ(found[0].permeability, found[1].permeability);
  EXPECT_EQ(found[0].steps, found[1].steps);
}

TEST(FineWalls, OddFactorsThatFillTheBoxAreNeeded) {
  const VoxelStack box = fine_box_of(4, 4, 4, [](double x, double, double) { return x < 1; });  // 12 fine voxels a side
  for (const std::uint32_t factor : {0u, 2u, 5u, 9u}) {
    const Result<stokes::Grid> grid = stokes::make_grid(box, factor, 3);
    ASSERT_FALSE(grid.ok()) << factor;
    EXPECT_EQ(grid.error().fault, Fault::kInput);
  }
}

}  // namespace
}  // namespace lamina
