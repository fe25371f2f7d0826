#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

#include "stages/pores/surface.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::kEdge;
using testing::random_box;
using testing::stack_of;
using testing::turned;
using testing::Voxels;

Voxels ball(std::uint32_t side, double radius, double shift = 0) {
  return Voxels(side, side, side).fill([&](auto x, auto y, auto z) {
    const double m = side / 2.0 + shift;
    return std::hypot(x + 0.5 - m, y + 0.5 - m, z + 0.5 - m) <= radius;
  });
}

TEST(Surface, OfABallIsRightToAPercent) {
  for (const double radius : {10.0, 14.3, 20.0}) {
    const Surface s = specific_surface(stack_of(ball(44, radius, 0.27), {true, true, true}, kEdge));
    const double expected = 4 * std::numbers::pi * radius * radius / (44.0 * 44 * 44) / 0.01;
    EXPECT_NEAR(s.crofton / expected, 1, 0.012) << radius;
    EXPECT_NEAR(s.faces / expected, 1.5, 0.03) << radius;
  }
}

// Normals of a wall weigh directions by their cosine: what the table of the header says.
TEST(Surface, OfAWallIsWhatTheHeaderSays) {
  const Voxels slab = Voxels(12, 12, 12).fill([](auto, auto, auto z) { return z < 5; });
  const double expected = 2 / (12 * 0.01);
  for (const auto& order : {std::array{0, 1, 2}, std::array{2, 0, 1}, std::array{1, 2, 0}}) {
    const Surface s = specific_surface(stack_of(turned(slab, order), {true, true, true}, kEdge));
    EXPECT_NEAR(s.faces, expected, 1e-9);
    EXPECT_NEAR(s.crofton / expected, 0.927, 0.001);
  }
  const Voxels aslant = Voxels(12, 12, 12).fill([](auto x, auto y, auto) { return (x + y) % 12 < 6; });
  const Surface s = specific_surface(stack_of(aslant, {true, true, true}, kEdge));
  EXPECT_NEAR(s.faces / (expected * std::numbers::sqrt2), std::numbers::sqrt2, 1e-9);
  EXPECT_NEAR(s.crofton / (expected * std::numbers::sqrt2), 0.933, 0.001);
}

TEST(Surface, WallsAtTheEndOfABoxAreNone) {
  const Voxels slab = Voxels(8, 8, 10).fill([](auto, auto, auto z) { return z < 5; });
  const Surface s = specific_surface(stack_of(slab, {}, kEdge));
  EXPECT_NEAR(s.faces, 1 / (9 * 0.01), 1e-9);  // one wall in nine pairs
  EXPECT_EQ(specific_surface(stack_of(Voxels(4, 4, 4, 1))).crofton, 0);
  EXPECT_EQ(specific_surface(stack_of(Voxels(4, 4, 4))).crofton, 0);
}

TEST(Surface, OfABodyCountsPairsWithinIt) {
  // The body is the lower half; the upper half, a checkerboard, does not count.
  const Voxels box = Voxels(8, 8, 12).fill([](auto x, auto y, auto z) { return z < 6 ? x < 4 : (x + y + z) % 2 == 0; });
  const Voxels body = Voxels(8, 8, 12).fill([](auto, auto, auto z) { return z < 6; });
  const Voxels half = Voxels(8, 8, 6).fill([](auto x, auto, auto) { return x < 4; });
  const VoxelStack inside = stack_of(body, {}, kEdge);
  const VoxelView view = inside;
  const Surface within = specific_surface(stack_of(box, {}, kEdge), &view),
                expected = specific_surface(stack_of(half, {}, kEdge));
  EXPECT_EQ(within.faces, expected.faces);
  EXPECT_EQ(within.crofton, expected.crofton);
}

// Differences between neighbours by testing each pair.
TEST(Surface, CrossingsAreThoseOfEveryPairOfVoxels) {
  for (std::uint32_t seed = 0; seed < 100; ++seed) {
    const Voxels box = random_box(seed);
    const std::array<bool, 3> periodic{seed % 2 == 0, seed % 4 < 2, seed % 8 < 4};
    const std::array<std::int64_t, 3> n{box.nx, box.ny, box.nz};
    const std::array<double, 13> share = shares_of_directions(kEdge);
    double expected = 0, faces = 0, shares = 0;
    for (std::size_t d = 0; d < 13; ++d) {
      std::uint64_t pairs = 0, different = 0;
      for (std::uint32_t z = 0; z < box.nz; ++z) {
        for (std::uint32_t y = 0; y < box.ny; ++y) {
          for (std::uint32_t x = 0; x < box.nx; ++x) {
            std::array<std::int64_t, 3> to{x, y, z};
            bool there = true;
            for (int i = 0; i < 3; ++i) {
              to[i] += kDirections[d][i];
              if (periodic[i]) to[i] = (to[i] + n[i]) % n[i];
              there = there && to[i] >= 0 && to[i] < n[i];
            }
            if (!there) continue;
            ++pairs;
            different += box.at(x, y, z) != box.at(static_cast<std::uint32_t>(to[0]), static_cast<std::uint32_t>(to[1]),
                                                   static_cast<std::uint32_t>(to[2]));
          }
        }
      }
      if (pairs == 0) continue;
      const double steps = d < 3   ? 1
                           : d < 9 ? 2
                                   : 3,
                   mean = static_cast<double>(different) / (static_cast<double>(pairs) * 0.01);
      expected += 2 * share[d] * mean / std::sqrt(steps);
      shares += share[d];
      if (d < 3) faces += mean;
    }
    const Surface s = specific_surface(stack_of(box, periodic, kEdge));
    EXPECT_NEAR(s.crofton, shares > 0 ? expected / shares : 0, 1e-9 * expected) << seed;
    EXPECT_NEAR(s.faces, faces, 1e-9 * faces) << seed;
  }
}

TEST(Surface, SharesOfDirectionsAreThePublishedOnesAndSumToOne) {
  const auto cubes = shares_of_directions({1000, 1000, 1000}), nearly = shares_of_directions({1'000'000, 1'000'001, 1'000'000});
  EXPECT_NEAR(std::accumulate(cubes.begin(), cubes.end(), 0.0), 1, 1e-9);
  for (std::size_t d = 0; d < 13; ++d) EXPECT_NEAR(cubes[d], nearly[d], 5e-4) << d;
}

// The same ball in voxels that are twice as high.
TEST(Surface, OfABallInVoxelsThatAreNoCubes) {
  const Voxels box = Voxels(44, 44, 22).fill([](auto x, auto y, auto z) {
    return std::hypot(x + 0.5 - 22, y + 0.5 - 22, 2 * (z + 0.5 - 11)) <= 18;
  });
  const Surface s = specific_surface(stack_of(box, {true, true, true}, {10'000, 10'000, 20'000}));
  EXPECT_NEAR(s.crofton / (4 * std::numbers::pi * 18 * 18 / (44.0 * 44 * 44) / 0.01), 1, 0.03);
}

TEST(Surface, TurnedAndMirroredBoxesAreTheSame) {
  const Voxels box = random_box(11, 14);
  const Surface straight = specific_surface(stack_of(box, {}, kEdge));
  const Surface other = specific_surface(stack_of(turned(box, {2, 0, 1}, {true, false, true}), {}, kEdge));
  EXPECT_NEAR(straight.crofton, other.crofton, 1e-12 * straight.crofton);
  EXPECT_NEAR(straight.faces, other.faces, 1e-12 * straight.faces);
}

}  // namespace
}  // namespace lamina::pores
