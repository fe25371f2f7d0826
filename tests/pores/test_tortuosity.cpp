#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "stages/pores/passages.h"
#include "stages/pores/porosity.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::stack_of;
using testing::turned;
using testing::Voxels;

Tortuosity of(const Voxels& box, int axis = 2, std::array<bool, 3> periodic = {}, std::array<Nm, 3> edge = {1000, 1000, 1000}) {
  const VoxelStack solid = stack_of(box, periodic, edge);
  return tortuosity(solid, whole(solid), axis);
}

TEST(Tortuosity, OfAStraightSlotIsOne) {
  const Voxels slot = Voxels(9, 9, 30).fill([](auto x, auto, auto) { return x < 3 || x >= 5; });
  const Tortuosity t = of(slot);
  EXPECT_EQ(t.mean, 1);
  EXPECT_EQ(t.maximum, 1);
  EXPECT_EQ(t.reached, 18u);
  EXPECT_EQ(of(slot, 1).mean, 1);
  EXPECT_EQ(of(slot, 0).reached, 0u);
  EXPECT_EQ(of(slot, 0).mean, 0);
}

TEST(Tortuosity, OfASlotAt45DegreesIsRootTwo) {
  // Of one way only, so that no way is cut short by the width of the slot; and of three.
  const Voxels narrow = Voxels(60, 3, 50).fill([](auto x, auto, auto z) { return !(x == z + 3 || x == z + 4); });
  EXPECT_NEAR(of(narrow).minimum, std::numbers::sqrt2 - (std::numbers::sqrt2 - 1) / 49, 1e-4);
  EXPECT_NEAR(of(narrow).maximum, std::numbers::sqrt2, 1e-4);
  const Voxels wide = Voxels(220, 3, 200).fill([](auto x, auto, auto z) { return x < z + 3 || x >= z + 9; });
  EXPECT_NEAR(of(wide).mean, std::numbers::sqrt2, 0.02);
  const Voxels around = Voxels(20, 3, 200).fill([](auto x, auto, auto z) { return (x + 400 - z) % 20 >= 6; });
  EXPECT_NEAR(of(around, 2, {true, false, false}).mean, std::numbers::sqrt2, 0.02);
}

// The direction between an axis and a diagonal is the worst in a plane: 8 % too long.
TEST(Tortuosity, OfASlotAt22DegreesIsTooLongAsTheHeaderSays) {
  const double slope = std::numbers::sqrt2 - 1;
  const Voxels slot = Voxels(260, 3, 600).fill([&](auto x, auto, auto z) { return x < z * slope + 1 || x >= z * slope + 5; });
  const double length = std::sqrt(1 + slope * slope);
  EXPECT_NEAR(of(slot).mean / length, length, 0.01);  // 1.082, which is by how much it is too long as well
}

TEST(Tortuosity, PathsDoNotLeaveByTheFacesThemselves) {
  // A solid lid in the middle: around a box that repeats along z one could reach the far face at once.
  const Voxels box = Voxels(4, 4, 9).fill([](auto, auto, auto z) { return z == 4; });
  EXPECT_EQ(of(box, 2, {true, true, true}).reached, 0u);
}

// Down a shaft, along a gallery and up again: lengths by hand, centre to centre, with corners cut by the diagonal.
TEST(Tortuosity, OfATrapIsItsLengthByHand) {
  Voxels box(12, 1, 11, 1);
  for (std::uint32_t z = 0; z <= 5; ++z) box.at(1, 0, z) = 0;
  for (std::uint32_t x = 1; x <= 9; ++x) box.at(x, 0, 5) = 0;
  for (std::uint32_t z = 5; z < 11; ++z) box.at(9, 0, z) = 0;
  EXPECT_NEAR(of(box).mean, (5 + 8 + 5 - 2 * (2 - std::numbers::sqrt2)) / 10, 1e-4);
}

TEST(Tortuosity, AStepAslantNeedsAWayAroundItsCorner) {
  Voxels box(2, 2, 2, 1);
  box.at(0, 0, 0) = box.at(1, 1, 1) = 0;
  EXPECT_EQ(of(box).reached, 0u);
  box.at(1, 0, 0) = 0;
  EXPECT_EQ(of(box).reached, 0u);
  box.at(1, 0, 1) = 0;
  const Tortuosity t = of(box);
  EXPECT_EQ(t.reached, 2u);
  EXPECT_NEAR(t.maximum, std::numbers::sqrt2, 1e-4);  // from the second voxel of the face
}

TEST(Tortuosity, FollowsTheEdgesOfVoxelsThatAreNoCubes) {
  const Voxels slot = Voxels(60, 3, 50).fill([](auto x, auto, auto z) { return !(x == z + 3 || x == z + 4); });
  EXPECT_NEAR(of(slot, 2, {}, {3000, 1000, 4000}).maximum, 5.0 / 4, 1e-4);
}

TEST(Tortuosity, PathsReachJustThePartsThatLeadThrough) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const Voxels box = testing::random_box(seed);
    const VoxelStack solid = stack_of(box, {seed % 2 == 0, seed % 3 == 0, false});
    for (int axis = 0; axis < 3; ++axis) {
      if (solid.periodic[static_cast<std::size_t>(axis)]) continue;
      const Tortuosity t = tortuosity(solid, whole(solid), axis);
      EXPECT_EQ(t.reached > 0, porosity(solid).through[static_cast<std::size_t>(axis)] > 0) << seed;
      if (t.reached > 0) {
        EXPECT_GE(t.minimum, 1);
        EXPECT_LE(t.minimum, t.mean);
        EXPECT_LE(t.mean, t.maximum);
      }
    }
  }
}

TEST(Tortuosity, TurnedAndMirroredBoxesAreTheSame) {
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    std::mt19937 random(seed);
    const Voxels box = Voxels(14, 13, 12).fill([&](auto, auto, auto) { return random() % 100 < 50; });
    const Tortuosity straight = of(box), other = of(turned(box, {2, 0, 1}, {false, true, true}), 0);
    EXPECT_EQ(straight.reached, other.reached);
    EXPECT_NEAR(straight.mean, other.mean, 1e-12);
    // From the other side the shortest way is the same.
    EXPECT_EQ(straight.minimum, of(turned(box, {0, 1, 2}, {false, false, true})).minimum);
  }
}

}  // namespace
}  // namespace lamina::pores
