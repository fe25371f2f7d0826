#include "stages/geometry/coverage.h"

#include <gtest/gtest.h>

#include "stages/data/levels.h"
#include "stages/geometry/combine.h"
#include "stages/geometry/run_rows.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

/// The fraction of each part by testing every pixel, in floating point.
std::vector<double> shares_by_pixels(const Runs& runs, const PixelWindow& window, std::uint32_t columns, std::uint32_t rows) {
  std::vector<double> shares(std::size_t{columns} * rows);
  const auto overlap = [](double pixel, double part, double size) {
    return std::max(0.0, std::min(pixel + 1, (part + 1) * size) - std::max(pixel, part * size));
  };
  const double part_width = double{1} * window.width() / columns, part_height = double{1} * window.height() / rows;
  for (std::uint32_t y = 0; y < window.height(); ++y) {
    const auto row = runs.view().row(window.top + y);
    for (std::size_t i = 0; i < row.size(); i += 2) {
      for (std::uint32_t column = row[i]; column < row[i + 1]; ++column) {
        if (column < window.left || column >= window.right) continue;
        for (std::uint32_t to_y = 0; to_y < rows; ++to_y) {
          for (std::uint32_t to_x = 0; to_x < columns; ++to_x) {
            shares[to_y * columns + to_x] +=
                overlap(column - window.left, to_x, part_width) * overlap(y, to_y, part_height) / (part_width * part_height);
          }
        }
      }
    }
  }
  return shares;
}

TEST(Coverage, IsTheShareOfTheAreaRegardlessOfTheScale) {
  std::mt19937 random(3);
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const std::uint32_t columns = 1 + testing::below(random, 40), rows = 1 + testing::below(random, 25);
    const Runs runs = testing::random_image(seed, columns, rows);
    PixelWindow window{testing::below(random, columns), 0, testing::below(random, rows), 0};
    window.right = window.left + 1 + testing::below(random, columns - window.left);
    window.bottom = window.top + 1 + testing::below(random, rows - window.top);
    const std::uint32_t to_columns = 1 + testing::below(random, 30), to_rows = 1 + testing::below(random, 30);
    std::vector<std::uint8_t> result(std::size_t{to_columns} * to_rows);
    box_coverage(runs, window, to_columns, result);
    const std::vector<double> expected = shares_by_pixels(runs, window, to_columns, to_rows);
    for (std::size_t i = 0; i < result.size(); ++i) ASSERT_NEAR(result[i], expected[i] * 255, 0.5 + 1e-6) << seed;
  }
}

TEST(Coverage, AFullImageIsFullAndAnEmptyOneEmpty) {
  const std::uint32_t side = 18898;
  const Runs full = testing::image_of(side, std::vector<testing::Row>(side, {0, side}));
  const Runs empty = testing::image_of(side, std::vector<testing::Row>(side));
  std::vector<std::uint8_t> result(500 * 377);
  box_coverage(full, {0, side, 0, side}, 500, result);
  EXPECT_EQ(std::count(result.begin(), result.end(), 255), 500 * 377);
  box_coverage(empty, {0, side, 0, side}, 500, result);
  EXPECT_EQ(std::count(result.begin(), result.end(), 0), 500 * 377);
}

TEST(Coverage, OfLevelsIsTheMeanOfTheirShares) {
  std::mt19937 random(4);
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const std::uint32_t columns = 1 + testing::below(random, 40), rows = 1 + testing::below(random, 25);
    const auto full = static_cast<std::uint8_t>(seed % 3 == 0 ? 1 : seed % 3 == 1 ? 1 + testing::below(random, 15) : 255);
    const PixelWindow window{0, columns, 0, rows};
    const std::uint32_t to_columns = 1 + testing::below(random, 30), to_rows = 1 + testing::below(random, 30);
    // Levels as a sum of planes, each of which counts for one part of the full level.
    Levels levels;
    std::vector<Runs> images{testing::random_image(seed, columns, rows)};
    levels_of(images.front(), 1, levels);
    std::vector<double> expected = shares_by_pixels(testing::random_image(seed, columns, rows), window, to_columns, to_rows);
    for (std::uint32_t plane = 1; plane < std::min<std::uint32_t>(full, 20); ++plane) {
      const Runs more = testing::random_image(1000 * plane + seed, columns, rows);
      const Levels before = levels;
      Levels one;
      levels_of(more, 1, one);
      add_levels(before, one, levels);
      const std::vector<double> shares = shares_by_pixels(more, window, to_columns, to_rows);
      for (std::size_t i = 0; i < shares.size(); ++i) expected[i] += shares[i];
      images.push_back(more);
    }
    std::vector<std::uint8_t> result(std::size_t{to_columns} * to_rows);
    box_coverage(levels, full, window, to_columns, result);
    for (std::size_t i = 0; i < result.size(); ++i) ASSERT_NEAR(result[i], expected[i] / full * 255, 0.5 + 1e-6) << seed;
    // The planes themselves, as rows of bits.
    const std::vector<RunRows> bits(images.begin(), images.end());
    std::vector<const BitRows*> planes;
    for (const RunRows& one : bits) planes.push_back(&one);
    std::vector<std::uint8_t> of_planes(result.size());
    box_coverage(planes, full, window, to_columns, of_planes);
    ASSERT_EQ(of_planes, result) << seed;
  }
}

TEST(PixelWindow, HoldsAllThatIsSetAndNoMore) {
  const PixelWindow window = window_of(testing::image_of(50, {{}, {7, 9, 20, 21}, {}, {5, 6}, {}}));
  EXPECT_EQ(window.left, 5u);
  EXPECT_EQ(window.right, 21u);
  EXPECT_EQ(window.top, 1u);
  EXPECT_EQ(window.bottom, 4u);
  EXPECT_TRUE(window_of(testing::image_of(50, {{}, {}})).empty());
  Levels levels;
  levels_of(testing::image_of(50, {{}, {7, 9, 20, 21}, {}, {5, 6}, {}}), 3, levels);
  EXPECT_EQ(window_of(levels).left, 5u);
  EXPECT_EQ(window_of(levels).right, 21u);
  EXPECT_EQ(window_of(levels).top, 1u);
  EXPECT_EQ(window_of(levels).bottom, 4u);
  EXPECT_EQ(joined(PixelWindow{}, window).right, 21u);
  EXPECT_EQ(joined(PixelWindow{1, 2, 1, 9}, window).bottom, 9u);
  EXPECT_EQ(joined(PixelWindow{1, 2, 1, 9}, window).right, 21u);
}

}  // namespace
}  // namespace lamina::formats
