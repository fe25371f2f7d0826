// tests/arrange/test_bed_level.cpp: positions of shapes on a bed, against a search cell by cell.
#include <gtest/gtest.h>

#include <cmath>
#include <optional>
#include <random>

#include "stages/arrange/fill_build.h"

namespace lamina::test {
namespace {

using namespace arrange;

std::uint32_t below(std::mt19937& random, std::uint32_t limit) { return static_cast<std::uint32_t>(random() % limit); }

BitShape random_shape(std::mt19937& random, std::uint32_t width, std::uint32_t depth) {
  BitShape shape(width, depth);
  for (std::uint32_t y = 0; y < depth; ++y) {
    const std::uint32_t begin = below(random, width), end = begin + 1 + below(random, width - begin);
    shape.set(y, begin, end);
    if (below(random, 3) == 0) shape.set(y, 0, 1);
  }
  shape.set(0, 0, 1), shape.set(depth - 1, width - 1, width);
  return shape;
}

bool meets(const BitShape& taken, const BitShape& shape, std::uint32_t x, std::uint32_t y) {
  for (std::uint32_t v = 0; v < shape.depth; ++v)
    for (std::uint32_t u = 0; u < shape.width; ++u)
      if (shape.at(u, v) && taken.at(x + u, y + v)) return true;
  return false;
}

TEST(BedLevel, FindsTheFirstFreePosition) {
  std::mt19937 random(5);
  for (int round = 0; round < 4; ++round) {
    BedCells bed{BitShape(150, 90), 1000, 0, 0};
    for (int i = 0; i < 30; ++i) {
      const std::uint32_t x = below(random, 150);
      bed.blocked.set(below(random, 90), x, std::min(150u, x + 1 + below(random, 20)));
    }
    BitShape taken = bed.blocked;
    BedLevel level(bed, 3);
    std::vector<BitShape> shapes;
    for (int i = 0; i < 3; ++i) shapes.push_back(random_shape(random, 1 + below(random, 80), 1 + below(random, 20)));
    for (int step = 0; step < 60; ++step) {
      const std::size_t number = below(random, 3);
      const BitShape& shape = shapes[number];
      std::optional<CellPosition> expected;
      for (std::uint32_t y = 0; !expected && y + shape.depth <= 90; ++y)
        for (std::uint32_t x = 0; !expected && x + shape.width <= 150; ++x)
          if (!meets(taken, shape, x, y)) expected = CellPosition{x, y};
      const auto found = level.find(number, SearchShape(shape));
      ASSERT_EQ(found.has_value(), expected.has_value());
      if (!found) continue;
      ASSERT_EQ(found->x, expected->x);
      ASSERT_EQ(found->y, expected->y);
      level.put({shape, 0}, *found);
      for (std::uint32_t v = 0; v < shape.depth; ++v)
        for (std::uint32_t u = 0; u < shape.width; ++u)
          if (shape.at(u, v)) taken.set(found->y + v, found->x + u, found->x + u + 1);
    }
  }
}

TEST(BedCells, OfARoundBedAreWithinItsMargin) {
  const std::vector<KeepOut> keep{{40'000'000, 40'000'000, 50'500'000, 45'000'000}};
  const BedCells bed = bed_cells({98'000'000, 98'000'000, 3'000'000, true}, keep, 500'000);
  EXPECT_EQ(bed.x0, 3'000'000);
  std::uint64_t free = 0;
  for (std::uint32_t y = 0; y < bed.blocked.depth; ++y) {
    for (std::uint32_t x = 0; x < bed.blocked.width; ++x) {
      if (bed.blocked.at(x, y)) continue;
      ++free;
      for (const double dx : {0.0, 0.5}) {
        for (const double dy : {0.0, 0.5}) EXPECT_LE(std::hypot(3 + x * 0.5 + dx - 49, 3 + y * 0.5 + dy - 49), 46 + 1e-9);
      }
      const double left = 3 + x * 0.5, front = 3 + y * 0.5;
      EXPECT_FALSE(left < 50.5 && left + 0.5 > 40 && front < 45 && front + 0.5 > 40);
    }
  }
  EXPECT_NEAR(static_cast<double>(free) * 0.25, M_PI * 46 * 46 - 10.5 * 5, 0.02 * M_PI * 46 * 46);
}

BitShape rectangle(std::uint32_t width, std::uint32_t depth) {
  BitShape shape(width, depth);
  for (std::uint32_t y = 0; y < depth; ++y) shape.set(y, 0, width);
  return shape;
}

NestShape nest_shape(std::uint32_t width, std::uint32_t depth, std::int64_t gap) {
  const BitShape shape = rectangle(width, depth);
  return {grown_shape(shape, 0, 1000), grown_shape(shape, gap, 1000), static_cast<double>(width * depth)};
}

TEST(FillBuild, TakesRanksBeforeSizes) {
  const BedCells bed{BitShape(20, 10), 1000, 0, 0};
  const std::vector<NestShape> shapes{nest_shape(20, 10, 0), nest_shape(5, 5, 0)};
  const auto count = [&](std::int32_t rank_of_small) {
    const std::vector<Demand> demands{{0, 1, {0, 0}, {0}, {}}, {1, 8, {rank_of_small, 0}, {1}, {}}};
    return fill_build(bed, shapes, demands, {}).size();
  };
  EXPECT_EQ(count(1), 1u) << "the large one of the better rank takes all";
  EXPECT_EQ(count(-1), 8u);
}

TEST(FillBuild, PutsAllOfAGroupOrNothing) {
  const BedCells bed{BitShape(20, 10), 1000, 0, 0};
  const std::vector<NestShape> shapes{nest_shape(10, 10, 0), nest_shape(4, 10, 0)};
  std::vector<Demand> demands{{0, 1, {0, 0}, {0}, 7}, {1, 3, {0, 0}, {1}, 7}, {2, 2, {1, 0}, {0}, {}}};
  const auto without = fill_build(bed, shapes, demands, {});
  ASSERT_EQ(without.size(), 2u) << "10 + 3 x 4 columns are too many: two of the other row";
  EXPECT_EQ(without[0].demand, 2u);
  demands[1].copies = 2;
  const auto with = fill_build(bed, shapes, demands, {});
  EXPECT_EQ(with.size(), 3u);
  for (const PutShape& put : with) EXPECT_LT(put.demand, 2u);
}

TEST(FillBuild, TurnsShapesAndKeepsTheGap) {
  // Rectangles of 10 x 4 on 12 x 22 cells: as they are, and upright where only that fits.
  const BedCells bed{BitShape(12, 22), 1000, 0, 0};
  const std::vector<NestShape> shapes{nest_shape(10, 4, 2000), nest_shape(4, 10, 2000)};
  const std::vector<Demand> demands{{0, 9, {0, 0}, {0, 1}, {}}};
  const std::vector<FixedShape> fixed{{grown_shape(rectangle(2, 22), 2000, 1000), {0, 0}}};
  const auto put = fill_build(bed, shapes, demands, fixed);
  ASSERT_EQ(put.size(), 2u) << "of 8 columns that are left, 4, and of 22 rows 10 + 2 + 10";
  EXPECT_EQ(put[0].shape, 1u);
  EXPECT_EQ(put[0].at.x, 4u);
  EXPECT_EQ(fill_build(bed, shapes, demands, {}).size(), 4u) << "rows of 4 with gaps of 2";
}

}  // namespace
}  // namespace lamina::test
