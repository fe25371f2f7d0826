#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "stages/pores/sizes.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::kEdge;
using testing::random_box;
using testing::stack_of;
using testing::turned;
using testing::Voxels;

constexpr double kVoxel = 0.01;  // mm

// One pore in a slice: where a point is, seen from the middle and turned by an angle, in voxels.
template <class Is>
Pore only_pore(std::uint32_t side, double degrees, const Is& is, double dx = 0, double dy = 0) {
  const double c = std::cos(degrees * std::numbers::pi / 180), s = std::sin(degrees * std::numbers::pi / 180);
  const Voxels box = Voxels(side, side, 1).fill([&](auto x, auto y, auto) {
    const double px = x + 0.5 - side / 2.0 - dx, py = y + 0.5 - side / 2.0 - dy;
    return !is(c * px + s * py, c * py - s * px);
  });
  const PoreSizes sizes = pore_sizes(stack_of(box, {}, kEdge));
  EXPECT_EQ(sizes.pores.size(), 1u);
  return sizes.pores.empty() ? Pore{} : sizes.pores[0];
}

TEST(PoreSizes, ARectangleAlongRowsIsMeasuredExactly) {
  const Pore pore = only_pore(120, 0, [](double x, double y) { return std::abs(x) < 45 && std::abs(y) < 7; });
  EXPECT_NEAR(pore.length_mm, 90 * kVoxel, 1e-12);
  EXPECT_NEAR(pore.width_mm, 14 * kVoxel, 1e-12);
  EXPECT_NEAR(pore.area_mm2, 90 * 14 * kVoxel * kVoxel, 1e-12);
  const Pore upright = only_pore(120, 90, [](double x, double y) { return std::abs(x) < 45 && std::abs(y) < 7; });
  EXPECT_EQ(upright.length_mm, pore.length_mm);
  EXPECT_EQ(upright.width_mm, pore.width_mm);
}

TEST(PoreSizes, TurnedRectanglesSlotsAndDiscsAreMeasuredToAboutAVoxel) {
  for (double degrees = 0; degrees < 180; degrees += 7.5) {
    const double shift = 0.01 * degrees;
    const Pore rectangle = only_pore(
        120, degrees, [](double x, double y) { return std::abs(x) <= 45 && std::abs(y) <= 7; }, shift, 0.3);
    EXPECT_NEAR(rectangle.length_mm, 90 * kVoxel, 1.2 * kVoxel) << degrees;
    EXPECT_NEAR(rectangle.width_mm, 14 * kVoxel, 1.2 * kVoxel) << degrees;
    const Pore slot = only_pore(
        120, degrees, [](double x, double y) { return std::hypot(std::max(std::abs(x) - 40, 0.0), y) <= 5; }, 0.2, shift);
    EXPECT_NEAR(slot.length_mm, 90 * kVoxel, 1.2 * kVoxel) << degrees;
    EXPECT_NEAR(slot.width_mm, 10 * kVoxel, 1.2 * kVoxel) << degrees;
    const Pore disc = only_pore(
        60, degrees, [](double x, double y) { return std::hypot(x, y) <= 20; }, shift, 0.4);
    EXPECT_NEAR(disc.length_mm, 40 * kVoxel, 1.2 * kVoxel) << degrees;
    EXPECT_NEAR(disc.width_mm, 40 * kVoxel, 1.2 * kVoxel) << degrees;
  }
}

// A pore between round ends of beads: a rectangle of 60 x 20 of which two half discs of radius 10 are taken away.
TEST(PoreSizes, APoreWithCuspsIsMeasuredFromTipToTip) {
  const Pore pore = only_pore(
      100, 0, [](double x, double y) { return std::abs(x) < 30 && std::abs(y) < 10 && std::hypot(std::abs(x) - 30, y) >= 10; });
  // In the outermost rows, 9.5 from the middle, the tips end at 30 - sqrt(100 - 9.5^2) = 26.9.
  EXPECT_NEAR(pore.length_mm, 54 * kVoxel, 1e-12);
  EXPECT_NEAR(pore.width_mm, 20 * kVoxel, 1e-12);
  EXPECT_NEAR(pore.area_mm2, (60 * 20 - 100 * std::numbers::pi) * kVoxel * kVoxel, 0.01 * pore.area_mm2);
}

TEST(PoreSizes, OnePixelAndDiagonalsOfPixels) {
  std::vector<Pixel> one{{5, 7}, {5, 7}};
  EXPECT_EQ(smallest_box(one, {10, 20}).length, 20);
  EXPECT_EQ(smallest_box(one, {10, 20}).width, 10);
  std::vector<Pixel> diagonal{{0, 0}, {1, 1}, {2, 2}, {3, 3}};
  EXPECT_NEAR(smallest_box(diagonal, {10, 10}).length, 40 * std::numbers::sqrt2,
              1e-9 + 40 * std::numbers::sqrt2 - 49.497474683058);
  EXPECT_NEAR(smallest_box(diagonal, {10, 10}).width, 7.0710678118655, 1e-9);
}

// No direction of 3,600 has a smaller box than the one found, other than by what pixels add.
TEST(SmallestBox, IsNoLargerThanThatOfAnyDirection) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Pixel> pixels(1 + random() % 30);
    const int wide = 1 + static_cast<int>(random() % 40), high = 1 + static_cast<int>(random() % 40);
    for (Pixel& p : pixels) {
      p = {static_cast<std::int32_t>(random() % wide), static_cast<std::int32_t>(random() % high)};
    }
    const std::vector<Pixel> all = pixels;
    const BoxSides box = smallest_box(pixels, {1000, 1000});
    double minimum = 1e300;
    for (int i = 0; i < 3600; ++i) {
      const double c = std::cos(i * std::numbers::pi / 3600), s = std::sin(i * std::numbers::pi / 3600);
      double low = 1e9, high_along = -1e9, left = 1e9, right = -1e9;
      for (const Pixel& p : all) {
        low = std::min(low, c * p.x + s * p.y), high_along = std::max(high_along, c * p.x + s * p.y);
        left = std::min(left, c * p.y - s * p.x), right = std::max(right, c * p.y - s * p.x);
      }
      const double pixel = std::max(std::abs(c), std::abs(s));
      minimum = std::min(minimum, (high_along - low + pixel) * (right - left + pixel));
    }
    // Between directions of hull edges the pixel's own share may be less: at most half of a pixel's 0.3 on each side.
    EXPECT_LE(box.length * box.width * 1e-6, minimum * 1.0001 + 0.3 * (box.length + box.width) * 1e-3 + 1e-9) << trial;
    EXPECT_GE(box.length * box.width * 1e-6, minimum * 0.99) << trial;
  }
}

TEST(PoreSizes, PoresThatAreCutOrEndlessAreCountedApart) {
  Voxels box(20, 20, 1, 1);
  for (std::uint32_t x = 0; x < 20; ++x) box.at(x, 3, 0) = 0;         // a channel along x
  for (std::uint32_t y = 18; y < 22; ++y) box.at(10, y % 20, 0) = 0;  // across the end of y
  box.at(5, 10, 0) = 0;
  const PoreSizes open = pore_sizes(stack_of(box, {}, kEdge));
  EXPECT_EQ(open.pores.size(), 1u);
  EXPECT_EQ(open.cut, 3u);
  EXPECT_NEAR(open.cut_mm2, 24 * kVoxel * kVoxel, 1e-12);
  const PoreSizes periodic = pore_sizes(stack_of(box, {true, true, false}, kEdge));
  EXPECT_EQ(periodic.cut, 0u);
  EXPECT_EQ(periodic.endless, 1u);
  EXPECT_NEAR(periodic.endless_mm2, 20 * kVoxel * kVoxel, 1e-12);
  ASSERT_EQ(periodic.channels_mm.size(), 1u);
  EXPECT_NEAR(periodic.channels_mm[0], kVoxel, 1e-12);
  ASSERT_EQ(periodic.pores.size(), 2u);
  EXPECT_NEAR(periodic.pores[0].length_mm, 4 * kVoxel, 1e-12);
  EXPECT_NEAR(periodic.pores[0].width_mm, kVoxel, 1e-12);
}

// Straight gaps along y of 3 and 5 voxels, and a slice whose gaps cross: a mesh has no width.
TEST(PoreSizes, ChannelsBetweenStraightBeadsHaveAMeanWidth) {
  const Voxels box = Voxels(20, 6, 2).fill(
      [](auto x, auto y, auto z) { return !((x >= 2 && x < 5) || (x >= 10 && x < 15) || (z == 1 && y == 3)); });
  const PoreSizes sizes = pore_sizes(stack_of(box, {true, true, true}, kEdge));
  EXPECT_EQ(sizes.endless, 3u);
  ASSERT_EQ(sizes.channels_mm.size(), 2u);
  EXPECT_NEAR(sizes.channels_mm[0], 3 * kVoxel, 1e-12);
  EXPECT_NEAR(sizes.channels_mm[1], 5 * kVoxel, 1e-12);
}

TEST(PoreSizes, APoreIsTheSameWhereverThePeriodBegins) {
  for (std::uint32_t shift = 0; shift < 40; shift += 3) {
    const Voxels box = Voxels(40, 30, 2).fill([&](auto x, auto y, auto) {
      const double px = (x + shift) % 40 - 20.0, py = (y + 2 * shift) % 30 - 15.0;
      return std::abs(px + py) > 9 || std::abs(px - py) > 3;
    });
    const PoreSizes sizes = pore_sizes(stack_of(box, {true, true, false}, kEdge));
    ASSERT_EQ(sizes.pores.size(), 2u) << shift;
    EXPECT_NEAR(sizes.pores[1].length_mm, 19 / std::numbers::sqrt2 * kVoxel, 1e-9);
    EXPECT_NEAR(sizes.pores[1].width_mm, 7 / std::numbers::sqrt2 * kVoxel, 1e-9);
    EXPECT_EQ(sizes.pores[1].slice, 1u);
  }
}

TEST(PoreSizes, PoresNextToVoidOutsideOfTheBodyAreCut) {
  Voxels solid(12, 12, 1), body(12, 12, 1);
  body.fill([](auto x, auto y, auto) { return x >= 2 && x < 10 && y >= 2 && y < 10; });
  solid = body;
  solid.at(2, 5, 0) = 0;
  solid.at(5, 5, 0) = 0;
  const VoxelStack inside = stack_of(body, {}, kEdge);
  const VoxelView view = inside;
  const PoreSizes sizes = pore_sizes(stack_of(solid, {}, kEdge), &view);
  EXPECT_EQ(sizes.pores.size(), 1u);
  EXPECT_EQ(sizes.cut, 1u);
}

TEST(PoreSizes, TurnedAndMirroredSlicesHaveTheSameHistogramsForAnyNumberOfThreads) {
  for (std::uint32_t seed = 0; seed < 30; ++seed) {
    const Voxels box = random_box(seed, 30);
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1 + seed % 3);
    const PoreSizes straight = pore_sizes(stack_of(box, {true, true, false}, kEdge));
    const PoreSizes other = pore_sizes(stack_of(turned(box, {1, 0, 2}, {true, false, true}), {true, true, false}, kEdge));
    EXPECT_EQ(lengths(straight, 0.7 * kVoxel, 40).bins, lengths(other, 0.7 * kVoxel, 40).bins) << seed;
    EXPECT_EQ(widths(straight, 0.7 * kVoxel, 40).bins, widths(other, 0.7 * kVoxel, 40).bins) << seed;
    EXPECT_EQ(straight.endless, other.endless);
  }
}

TEST(Distribution, MeanDeviationAndBinsByHand) {
  const std::vector<double> values{1, 2, 4, 9};
  const Distribution d = distribution(values, 2, 3);
  EXPECT_EQ(d.count, 4u);
  EXPECT_DOUBLE_EQ(d.mean, 4);
  EXPECT_DOUBLE_EQ(d.deviation, std::sqrt((9 + 4 + 0 + 25) / 3.0));
  EXPECT_EQ(d.bins, (std::vector<std::uint64_t>{1, 1, 2}));
  EXPECT_EQ(distribution({}, 1, 2).count, 0u);
  EXPECT_EQ(distribution(std::vector<double>{3}, 1, 2).deviation, 0);
}

}  // namespace
}  // namespace lamina::pores
