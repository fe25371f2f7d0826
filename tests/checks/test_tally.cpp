// What layers hold of solids, against images whose pixels are counted one by one.
#include <gtest/gtest.h>

#include <random>

#include "stages/checks/solid_checks.h"

namespace lamina::checks {
namespace {

constexpr std::int64_t kPixel = 100'000;  // nm

PixelGrid grid_of(std::uint32_t columns, std::uint32_t rows) {
  return {PixelAxis(1000, columns * kPixel, 1000 * kPixel), PixelAxis(1000, rows * kPixel, 1000 * kPixel)};
}

/// The box around these pixels; rows count from the back, as those of images.
Box box_of(const PixelGrid& grid, Nm left, Nm right, Nm top, Nm bottom, Nm height) {
  const Nm pixel = kPixel, rows = static_cast<Nm>(grid.rows());
  return {{left * pixel, (rows - bottom) * pixel, 0}, {right * pixel, (rows - top) * pixel, height}};
}

/// Pixels that are set by chance, as runs. `set` counts those within the window.
Runs random_image(std::mt19937& random, const PixelGrid& grid, const std::array<std::uint32_t, 4>& window, std::uint64_t& set) {
  Runs runs;
  runs.columns = grid.columns();
  runs.row_offset.push_back(0);
  for (std::uint32_t row = 0; row < grid.rows(); ++row) {
    std::vector<bool> pixel(grid.columns() + 1);
    for (std::uint32_t c = 0; c < grid.columns(); ++c) {
      pixel[c] = random() % 3 == 0;
      set += pixel[c] && c >= window[0] && c < window[1] && row >= window[2] && row < window[3] ? 1 : 0;
    }
    for (std::uint32_t c = 0; c <= grid.columns(); ++c) {
      if ((c > 0 && pixel[c - 1]) != pixel[c]) runs.change.push_back(c);
    }
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

Runs mirrored(const Runs& image) {
  Runs out;
  out.columns = image.columns;
  out.row_offset.push_back(0);
  for (std::uint32_t row = image.view().rows(); row-- > 0;) {
    const auto changes = image.view().row(row);
    for (auto it = changes.rbegin(); it != changes.rend(); ++it) out.change.push_back(image.columns - *it);
    out.row_offset.push_back(static_cast<std::uint32_t>(out.change.size()));
  }
  return out;
}

TEST(Tally, CountsEveryPixelOfLowSolids) {
  std::mt19937 random(7);
  const PixelGrid grid = grid_of(40, 30);
  for (int trial = 0; trial < 50; ++trial) {
    // Up to 15 rows are all inspected.
    const auto left = random() % 20, right = left + 1 + random() % 20, top = random() % 15, bottom = top + 1 + random() % 15;
    const std::array<std::uint32_t, 4> window{static_cast<std::uint32_t>(left), static_cast<std::uint32_t>(right),
                                              static_cast<std::uint32_t>(top), static_cast<std::uint32_t>(bottom)};
    Tally tally({{box_of(grid, static_cast<Nm>(left), static_cast<Nm>(right), static_cast<Nm>(top), static_cast<Nm>(bottom),
                         1'000'000)}});
    tally.inspect_layers(grid);
    std::uint64_t set = 0;
    for (std::uint32_t i = 0; i < 4; ++i) {
      const Layer layer{i, static_cast<Nm>(i) * 250'000, 250'000};
      const Runs image = random_image(random, grid, window, set);
      tally.add_image(layer, image);
      tally.add_left(layer, mirrored(image), true, true);
    }
    EXPECT_NEAR(tally.planned_mm3(0), static_cast<double>(set) * 0.1 * 0.1 * 0.25, 1e-5);
    EXPECT_DOUBLE_EQ(tally.left_mm3(0), tally.planned_mm3(0));
    EXPECT_EQ(tally.detected(0), set > 0);
  }
}

TEST(Tally, EstimatesHighSolidsFromSomeRows) {
  std::mt19937 random(8);
  const PixelGrid grid = grid_of(60, 200);
  const std::array<std::uint32_t, 4> window{10, 50, 20, 180};
  Tally tally({{box_of(grid, 10, 50, 20, 180, 100'000'000)}});
  tally.inspect_layers(grid);
  std::uint64_t set = 0;
  for (std::uint32_t i = 0; i < 100; ++i) {
    tally.add_image({i, static_cast<Nm>(i) * 1'000'000, 1'000'000}, random_image(random, grid, window, set));
  }
  EXPECT_NEAR(tally.planned_mm3(0) / (static_cast<double>(set) * 0.1 * 0.1), 1, 0.02);
}

TEST(Tally, DistinguishesSolids) {
  const PixelGrid grid = grid_of(40, 30);
  Tally tally({{box_of(grid, 2, 8, 5, 9, 1'000'000), 0, 0, 3}, {box_of(grid, 20, 28, 5, 9, 1'000'000), 1, 1, -5}});
  tally.inspect_layers(grid);
  Runs image;
  image.columns = 40;
  image.row_offset.assign(31, 0);
  image.change = {3, 5};  // row 6
  for (std::uint32_t row = 7; row <= 30; ++row) image.row_offset[row] = 2;
  tally.add_image({0, 0, 500'000}, image);
  EXPECT_TRUE(tally.detected(0));
  EXPECT_FALSE(tally.detected(1));
  EXPECT_NEAR(tally.planned_mm3(0), 2 * 0.1 * 0.1 * 0.5, 1e-6);
  EXPECT_EQ(tally.planned_mm3(1), 0);
  EXPECT_EQ(tally.groups()[1].max_mm3, 5);  // inside out is solid too
}

TEST(Tally, SumsAreasOfContours) {
  Tally tally({{Box{{0, 0, 0}, {1, 1, 1}}, 0, 0, 1}, {Box{{0, 0, 0}, {2, 1, 1}}, 0, 0, 2}});
  EXPECT_FALSE(tally.detected(0));
  tally.add_area(0, {0, 0, 200'000}, 12.5);
  tally.add_area(0, {1, 200'000, 100'000}, 5);
  EXPECT_NEAR(tally.planned_mm3(0), 3.0, 1e-6);
  EXPECT_TRUE(tally.detected(0) && tally.detected(1));
  EXPECT_EQ(tally.groups()[0].min_mm3, 2);
  EXPECT_EQ(tally.groups()[0].max_mm3, 3);
}

}  // namespace
}  // namespace lamina::checks
