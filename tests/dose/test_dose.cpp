#include <gtest/gtest.h>

#include <cmath>

#include "stages/dose/dither.h"
#include "stages/dose/edges.h"
#include "stages/dose/shares.h"
#include "stages/geometry/drop_rows.h"
#include "tests/program/machines.h"

namespace lamina::dose {
namespace {

using program::testing::Image;
using program::testing::Random;
using program::testing::random_image;
using program::testing::runs_of;

Image image_of(const RunsView& runs) {
  Image image(runs.rows(), std::vector<int>(runs.columns, 0));
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const auto row = runs.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      EXPECT_LT(row[i], row[i + 1]);
      if (i > 0) {
        EXPECT_GT(row[i], row[i - 1]);
      }
      for (std::uint32_t c = row[i]; c < row[i + 1]; ++c) image[r][c] = 1;
    }
  }
  return image;
}

// Squared distance in pixels of the half axes to the nearest pixel that is not set; pixels beyond the image are not.
Image slow_erosion(const Image& image, double px, double py, double x, double y) {
  const auto rows = static_cast<int>(image.size()), columns = static_cast<int>(image[0].size());
  const int far_x = static_cast<int>(x / px) + 1, far_y = static_cast<int>(y / py) + 1;
  Image left = image;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      for (int j = -far_y; j <= far_y; ++j) {
        for (int i = -far_x; i <= far_x; ++i) {
          const bool set = r + j >= 0 && r + j < rows && c + i >= 0 && c + i < columns && image[r + j][c + i] == 1;
          const double dx = i == 0 ? 0 : x == 0 ? 1e9 : i * px / x, dy = j == 0 ? 0 : y == 0 ? 1e9 : j * py / y;
          if (!set && dx * dx + dy * dy <= 1 + 1e-12) left[r][c] = 0;
        }
      }
    }
  }
  return left;
}

TEST(Erode, IsTheExactEllipticDistanceToTheNearestUnsetPixel) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    const PixelGrid grid{PixelAxis(seed % 2 ? 600 : 1200, 2'000'000), PixelAxis(seed % 3 ? 400 : 1200, 1'500'000)};
    const double px = 25.4e6 / static_cast<double>(grid.x.dots), py = 25.4e6 / static_cast<double>(grid.y.dots);
    Image image = random_image(random, grid.columns(), grid.rows());
    for (auto& row : image) {
      for (auto& pixel : row) pixel = pixel == 1 || random() % 3 == 0 ? (random() % 100 > 1) : pixel;
    }
    const std::int64_t x = random() % 4 == 0 ? 0 : random() % 200'000;
    const std::int64_t y = random() % 4 == 0 ? 0 : seed % 5 == 0 ? x : random() % 200'000;
    Runs left;
    erode(runs_of(image), reach_of(grid, x, y), left);
    ASSERT_EQ(image_of(left), slow_erosion(image, px, py, static_cast<double>(x), static_cast<double>(y)))
        << "seed " << seed << " " << x << " " << y;
  }
}

// Reaches of many rows, over discs, holes and specks: every pixel by the rows of the reach.
TEST(Erode, OfFarReachesIsThatOfEachPixel) {
  const PixelGrid grid{PixelAxis(1, 100'000, 1000), PixelAxis(1, 100'000, 1000)};  // pixels of 1 um
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    Random random(seed);
    const int columns = 20 + static_cast<int>(random() % 250), rows = 20 + static_cast<int>(random() % 200);
    Image image(static_cast<std::size_t>(rows), std::vector<int>(static_cast<std::size_t>(columns), random() % 3 != 0 ? 1 : 0));
    const auto at = [&](int r, int c) -> int& { return image[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)]; };
    for (unsigned disc = random() % 8; disc > 0; --disc) {
      const int x = static_cast<int>(random() % 270), y = static_cast<int>(random() % 220),
                radius = static_cast<int>(random() % 100);
      const int value = random() % 2 != 0 ? 1 : 0;
      for (int r = 0; r < rows; ++r) {
        for (int c = 0; c < columns; ++c) {
          if ((r - y) * (r - y) + (c - x) * (c - x) < radius * radius) at(r, c) = value;
        }
      }
    }
    for (unsigned speck = random() % 6; speck > 0; --speck)
      at(static_cast<int>(random() % unsigned(rows)), static_cast<int>(random() % unsigned(columns))) ^= 1;
    const std::int64_t x = random() % 60'000, y = random() % 3 == 0 ? random() % 60'000 : x;
    const Reach reach = reach_of(grid, x, y);
    if (reach.half_width.empty()) continue;
    Image expected = image;
    const int far = static_cast<int>(reach.half_width.size()) - 1;
    for (int r = 0; r < rows; ++r) {
      for (int j = -far; j <= far; ++j) {
        const int width = static_cast<int>(reach.half_width[static_cast<std::size_t>(std::abs(j))]);
        std::vector<int> set{0};  // pixels before each column
        for (int c = 0; c < columns; ++c) set.push_back(set.back() + (r + j >= 0 && r + j < rows ? at(r + j, c) : 0));
        for (int c = 0; c < columns; ++c) {
          const bool within = c >= width && c + width < columns;
          if (!within || set[static_cast<std::size_t>(c + width + 1)] - set[static_cast<std::size_t>(c - width)] <= 2 * width)
            expected[static_cast<std::size_t>(r)][static_cast<std::size_t>(c)] = 0;
        }
      }
    }
    Runs left;
    erode(runs_of(image), reach, left);
    ASSERT_EQ(image_of(left), expected) << "seed " << seed << " " << x << " " << y;
  }
}

TEST(Erode, RadiiOfWholePixelsTakeThePixelsAtExactlyThatDistance) {
  const PixelGrid grid{PixelAxis(1, 100'000, 1000), PixelAxis(1, 100'000, 1000)};                    // pixels of 1 um
  EXPECT_EQ(reach_of(grid, 5000, 5000).half_width, (std::vector<std::uint32_t>{5, 4, 4, 4, 3, 0}));  // 3-4-5
  EXPECT_EQ(reach_of(grid, 4999, 4999).half_width, (std::vector<std::uint32_t>{4, 4, 4, 3, 2}));
  EXPECT_TRUE(reach_of(grid, 0, 0).half_width.empty());
  EXPECT_EQ(reach_of(grid, 3000, 0).half_width, (std::vector<std::uint32_t>{3}));
  EXPECT_EQ(reach_of(grid, 0, 2000).half_width, (std::vector<std::uint32_t>{0, 0, 0}));
}

/// Whether a pixel of a core is jetted.
bool core_pixel(std::uint32_t column, std::uint32_t row, std::uint32_t layer, std::uint32_t threshold) {
  return column * 2'654'435'769u + row * 1'300'411'463u + layer * 1'779'033'705u < threshold;
}

/// What is jetted of an image whose core gets a share of its pixels.
Runs thinned(const RunsView& image, const RunsView& core, double share, std::uint32_t layer) {
  Levels all, zones, levels;
  levels_of(image, 1, all);
  mark_core(all, core, 1, zones);
  DropPatterns patterns;
  make_core(share, layer, patterns);
  const DropImageView drops{zones, &patterns};
  Runs plane, same;
  runs_of(drops, 0, plane);
  levels_of(drops, levels);
  threshold_levels(levels, 1, same);
  EXPECT_EQ(plane.change, same.change);
  DropCounter counter;
  counter.start(patterns);
  EXPECT_EQ(DropTotals(drops, counter).drops(), set_pixels(plane));
  return plane;
}

TEST(Saturate, TheShareOfSetPixelsIsTheRequestedOneWithinATenthOfAPercent) {
  const std::uint32_t side = 1500;
  Runs full;
  full.columns = side;
  for (std::uint32_t r = 0; r <= side; ++r) full.row_offset.push_back(2 * r);
  for (std::uint32_t r = 0; r < side; ++r) full.change.insert(full.change.end(), {0u, side});
  for (const double share : {0.0, 0.03, 0.25, 0.5, 0.6180339887, 2.0 / 3, 0.8, 0.97}) {
    for (const std::uint32_t layer : {0u, 1u, 77u, 5000u}) {
      const Runs result = thinned(full, full, share, layer);
      const double set = static_cast<double>(set_pixels(result)) / side / side;
      EXPECT_NEAR(set, share, 0.001) << share << " layer " << layer;
    }
  }
}

// Shares whose pixels begin and end at one value in pairs, and steps of turned images, with and without a table.
TEST(Saturate, WordsOfTheTableAreThoseOfEachPixel) {
  Random random(8);
  for (const double share : {0.0, 1e-9, 0.0137, 0.381966011, 0.5, 0.6180339887, 0.93, 1.0}) {
    for (const std::uint32_t step : {2'654'435'769u, 0u - 2'654'435'769u, 1'300'411'463u, 0u - 1'300'411'463u, 1u << 20}) {
      DropPatterns patterns;
      CorePattern& core = patterns.core;
      core.column_step = step, core.row_step = 1, core.threshold = core_threshold(share);
      const DropZone zone{0, DropZone::Extra::kCore, 0};
      tabulate(core);
      EXPECT_EQ(core.words.empty(), step == 1u << 20);
      for (std::uint32_t i = 0; i < 3000; ++i) {
        // At and next to the values from which on a pixel turns, and anywhere.
        const std::uint32_t bit = i % 64, near = i / 64 % 4 - 2, at = i % 2 != 0 ? core.threshold : 0;
        core.first = i < 1000 ? at - bit * step + near : static_cast<std::uint32_t>(random());
        std::uint64_t expected = 0;
        for (std::uint32_t c = 0; c < 64; ++c) expected |= std::uint64_t{core.first + c * step < core.threshold} << c;
        ASSERT_EQ(extra_bits(patterns, zone, 0, 0), expected) << share << " " << step << " " << core.first;
      }
    }
  }
}

TEST(Saturate, NoPixelColumnIsAStreakInAnyDirection) {
  for (const double share : {0.2, 0.5, 0.7}) {
    const std::uint32_t threshold = core_threshold(share);
    // Along each axis, from many starts: the share holds over 1000 pixels, and no stretch is longer than a few drops need.
    for (int axis = 0; axis < 3; ++axis) {
      for (std::uint32_t start = 0; start < 200; ++start) {
        std::uint32_t set = 0, span = 0, longest = 0;
        for (std::uint32_t k = 0; k < 1000; ++k) {
          const bool now = axis == 0   ? core_pixel(k, start, start * 7, threshold)
                           : axis == 1 ? core_pixel(start, k, start * 7, threshold)
                                       : core_pixel(start, start * 3, k, threshold);
          set += now;
          span = now ? span + 1 : 0;
          longest = std::max(longest, span);
        }
        EXPECT_NEAR(set / 1000.0, share, 0.01);
        EXPECT_LE(longest, 8u) << "axis " << axis << " share " << share;
      }
    }
  }
}

TEST(Saturate, TheShellStaysFullAndPatternsDifferFromLayerToLayer) {
  Random random(3);
  const PixelGrid grid{PixelAxis(600, 8'000'000), PixelAxis(600, 8'000'000)};
  Image image(grid.rows(), std::vector<int>(grid.columns(), 0));
  for (std::uint32_t r = 20; r < 150; ++r) {
    for (std::uint32_t c = 10; c < 170; ++c) image[r][c] = (r - 80) * (r - 80) + (c - 90) * (c - 90) > 400;
  }
  const Runs runs = runs_of(image);
  Runs core;
  erode(runs, reach_of(grid, 500'000, 500'000), core);
  const Runs first = thinned(runs, core, 0.4, 10), second = thinned(runs, core, 0.4, 11);
  const Image inner = image_of(core), one = image_of(first), other = image_of(second);
  std::uint64_t differ = 0, pixels = 0;
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    for (std::uint32_t c = 0; c < grid.columns(); ++c) {
      if (inner[r][c] == 0) {
        EXPECT_EQ(one[r][c], image[r][c]);
      } else {
        EXPECT_EQ(one[r][c], core_pixel(c, r, 10, core_threshold(0.4)));
        ++pixels;
        differ += one[r][c] != other[r][c];
      }
    }
  }
  EXPECT_GT(pixels, 5000u);
  EXPECT_GT(differ, pixels / 2);
}

}  // namespace
}  // namespace lamina::dose
