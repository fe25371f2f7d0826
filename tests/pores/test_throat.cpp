#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "stages/pores/passages.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::kEdge;
using testing::random_box;
using testing::stack_of;
using testing::turned;
using testing::Voxels;

std::vector<double> slow_distances(const Voxels& box, std::array<bool, 3> periodic, std::array<double, 3> edge) {
  const std::array<int, 3> n{static_cast<int>(box.nx), static_cast<int>(box.ny), static_cast<int>(box.nz)};
  std::vector<double> result(box.solid.size(), std::numeric_limits<double>::infinity());
  for (std::size_t to = 0; to < box.solid.size(); ++to) {
    for (std::size_t from = 0; from < box.solid.size(); ++from) {
      if (box.solid[from] == 0) continue;
      std::array<std::size_t, 2> rest{to, from};
      double squared = 0;
      for (int i = 0; i < 3; ++i) {
        int away = std::abs(static_cast<int>(rest[0] % n[i]) - static_cast<int>(rest[1] % n[i]));
        if (periodic[i]) away = std::min(away, n[i] - away);
        squared += away * edge[i] * away * edge[i];
        rest = {rest[0] / n[i], rest[1] / n[i]};
      }
      result[to] = std::min(result[to], squared);
    }
  }
  return result;
}

TEST(Distances, AreThoseToEverySolidVoxel) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    Voxels box = random_box(seed, 12);
    if (seed % 2 == 0) {  // few solid voxels: long distances
      std::mt19937 random(seed);
      box.fill([&](auto, auto, auto) { return random() % 60 == 0; });
    }
    const std::array<bool, 3> periodic{seed % 3 == 0, seed % 5 < 2, seed % 7 < 3};
    const bool cubes = seed % 4 != 3;
    const Distances found =
        distances(stack_of(box, periodic, {1000, cubes ? 1000 : 1500, cubes ? 1000 : 2000}), whole(stack_of(box)));
    const std::vector<double> expected = slow_distances(box, periodic, {1, cubes ? 1 : 1.5, cubes ? 1.0 : 2.0});
    ASSERT_EQ(found.squared.size(), expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) ASSERT_EQ(found.squared[i], static_cast<float>(expected[i])) << seed;
  }
}

// Floods from the lower face through voxels of at least each distance in turn.
double slow_throat(const Voxels& box, const std::vector<double>& squared) {
  std::vector<double> levels = squared;
  std::ranges::sort(levels, std::greater<>());
  for (const double level : levels) {
    if (level == 0) break;
    std::vector<std::array<std::uint32_t, 3>> waiting;
    std::vector<bool> detected(box.solid.size());
    const auto enter = [&](const std::array<std::uint32_t, 3>& at) {
      const std::size_t index = box.index(at[0], at[1], at[2]);
      if (detected[index] || squared[index] < level) return;
      detected[index] = true;
      waiting.push_back(at);
    };
    for (std::uint32_t y = 0; y < box.ny; ++y) {
      for (std::uint32_t x = 0; x < box.nx; ++x) enter({x, y, 0});
    }
    while (!waiting.empty()) {
      const auto at = waiting.back();
      waiting.pop_back();
      if (at[2] + 1 == box.nz) return std::isinf(level) ? level : std::max(0.0, 2 * std::sqrt(level) - 1);
      testing::for_each_neighbour(box, {}, at, [&](const auto& to, int, int) { enter(to); });
    }
  }
  return 0;
}

TEST(Throat, IsThatOfFloodsThroughFartherAndNearerVoxels) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    Voxels box = random_box(seed, 9);
    std::mt19937 random(seed + 1000);
    box.fill([&](auto, auto, auto) { return random() % 100 < seed % 40; });
    const double expected = slow_throat(box, slow_distances(box, {}, {1, 1, 1}));
    const VoxelStack solid = stack_of(box, {}, kEdge);
    const double found = throats(solid, whole(solid))[2];
    if (std::isinf(expected)) {
      EXPECT_TRUE(std::isinf(found));
    } else {
      EXPECT_NEAR(found, expected * 0.01, 1e-12) << seed;
    }
  }
}

TEST(Throat, OfAStraightSlotIsItsWidthIfThatIsOdd) {
  for (std::uint32_t width = 1; width < 9; ++width) {
    const Voxels box = Voxels(20, 30, 8).fill([&](auto x, auto, auto) { return x < 5 || x >= 5 + width; });
    const VoxelStack solid = stack_of(box, {false, true, false}, kEdge);
    const auto all = throats(solid, whole(solid), {true, true, true});
    EXPECT_NEAR(all[2], 0.01 * (width % 2 == 1 ? width : width - 1), 1e-12);
    EXPECT_EQ(all[1], all[2]);
    EXPECT_EQ(all[0], 0);
  }
}

TEST(Throat, OfARoundHoleWithANeckIsTheNeck) {
  const Voxels box = Voxels(40, 40, 30).fill([&](auto x, auto y, auto z) {
    const double radius = 5.5 + std::abs(z - 14.0) * 0.6;
    return std::hypot(x - 20.0, y - 20.0) >= radius;
  });
  const VoxelStack solid = stack_of(box, {}, kEdge);
  EXPECT_NEAR(throats(solid, whole(solid))[2], 0.11, 0.01);
  // Above the neck it is wider.
  EXPECT_GT(throats(solid, {{0, 0, 20}, {40, 40, 30}})[2], 0.17);
}

TEST(Throat, OfBallsBetweenBallsIsThatOfTheirGaps) {
  // A cubic lattice of balls of radius 10, 30 apart: along an axis between four of them, 30 sqrt 2 - 20 = 22.4 wide.
  const Voxels box =
      Voxels(30, 30, 30).fill([](auto x, auto y, auto z) { return std::hypot(x - 7.0, y - 7.0, z - 7.0) <= 10; });
  const VoxelStack solid = stack_of(box, {true, true, true}, kEdge);
  const auto all = throats(solid, whole(solid), {true, true, true});
  EXPECT_NEAR(all[2], 0.224, 0.012);
  EXPECT_EQ(all[0], all[2]);
  EXPECT_EQ(all[1], all[2]);
}

TEST(Throat, TurnedAndMirroredBoxesAndAnyNumberOfThreadsAreTheSame) {
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    const Voxels box = Voxels(10, 11, 12).fill([&](auto, auto, auto) { return random() % 100 < 12; });
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1 + seed % 3);
    const VoxelStack straight = stack_of(box, {true, false, seed % 2 == 0}, kEdge);
    const VoxelStack other = stack_of(turned(box, {1, 2, 0}, {true, false, true}), {false, seed % 2 == 0, true}, kEdge);
    const auto one = throats(straight, whole(straight), {true, true, true});
    const auto two = throats(other, whole(other), {true, true, true});
    EXPECT_EQ(one[0], two[2]);
    EXPECT_EQ(one[1], two[0]);
    EXPECT_EQ(one[2], two[1]);
  }
}

TEST(Throat, OfNothingSolidIsInfiniteAndOfAFullBoxNone) {
  const VoxelStack none = stack_of(Voxels(5, 5, 5)), full = stack_of(Voxels(5, 5, 5, 1));
  EXPECT_TRUE(std::isinf(throats(none, whole(none))[2]));
  EXPECT_EQ(throats(full, whole(full))[2], 0);
}

}  // namespace
}  // namespace lamina::pores
