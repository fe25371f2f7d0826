// Edges that grow, holes, and the zones of parts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "stages/data/grid.h"
#include "stages/data/levels.h"
#include "stages/data/runs.h"
#include "stages/dose/edges.h"
#include "stages/dose/layer_drops.h"
#include "tests/program/machines.h"

namespace lamina::dose {
namespace {

using program::testing::Image;
using program::testing::Random;
using program::testing::runs_of;

/// Blobs of several sizes, so that there are edges, holes and narrow places.
Image blots(Random& random, std::uint32_t columns, std::uint32_t rows) {
  Image image(rows, std::vector<int>(columns, 0));
  for (std::uint32_t blot = 0; blot < 12; ++blot) {
    const std::uint32_t c = random() % columns, r = random() % rows, w = 1 + random() % 14, h = 1 + random() % 14;
    const int value = random() % 3 == 0 ? 0 : 1;
    for (std::uint32_t i = r; i < std::min(rows, r + h); ++i) {
      for (std::uint32_t k = c; k < std::min(columns, c + w); ++k) image[i][k] = value;
    }
  }
  for (std::uint32_t dot = 0; dot < 15; ++dot) image[random() % rows][random() % columns] ^= 1;
  return image;
}

Image pixels_of(const RunsView& runs) {
  Image image(runs.rows(), std::vector<int>(runs.columns, 0));
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    const auto row = runs.row(r);
    for (std::size_t i = 0; i + 1 < row.size(); i += 2) {
      EXPECT_LT(row[i], row[i + 1]);
      EXPECT_LE(row[i + 1], runs.columns);
      if (i > 0) {
        EXPECT_GT(row[i], row[i - 1]);
      }
      for (std::uint32_t c = row[i]; c < row[i + 1]; ++c) image[r][c] = 1;
    }
  }
  return image;
}

Image with_border(const Image& image, std::size_t width) {
  Image wide(image.size() + 2 * width, std::vector<int>(image[0].size() + 2 * width, 0));
  for (std::size_t r = 0; r < image.size(); ++r)
    std::ranges::copy(image[r], wide[r + width].begin() + static_cast<long>(width));
  return wide;
}

/// By its definition: set where a pixel within reach is.
Image grown_slowly(const Image& image, const Reach& reach) {
  const auto rows = static_cast<int>(image.size()), columns = static_cast<int>(image[0].size());
  Image grown = image;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      for (int j = 0; j < static_cast<int>(reach.half_width.size()); ++j) {
        const auto width = static_cast<int>(reach.half_width[static_cast<std::size_t>(j)]);
        for (int k = std::max(0, c - width); k <= std::min(columns - 1, c + width); ++k) {
          if ((r >= j && image[r - j][k] == 1) || (r + j < rows && image[r + j][k] == 1)) grown[r][c] = 1;
        }
      }
    }
  }
  return grown;
}

TEST(Dilate, SetsWhatHasASetPixelWithinReachAndReportsWhatWouldLeaveTheImage) {
  for (std::uint32_t seed = 0; seed < 80; ++seed) {
    Random random(seed);
    const PixelGrid grid{PixelAxis(seed % 2 ? 600 : 1200, 2'000'000), PixelAxis(600, 2'000'000)};
    const Reach reach = reach_of(grid, random() % 200'000, random() % 200'000);
    const std::size_t border = 12;
    Image image = blots(random, 45, 38);
    if (seed % 4 == 0) image = with_border(image, 8);  // may stay within
    Runs grown;
    dilate(runs_of(image), reach, grown);
    ASSERT_EQ(pixels_of(grown), reach.half_width.empty() ? image : grown_slowly(image, reach)) << "seed " << seed;
    const Image wide = grown_slowly(with_border(image, border), reach);
    Image cut = with_border(pixels_of(grown), border);
    EXPECT_EQ(grows_beyond(runs_of(image), reach), wide != cut) << "seed " << seed;
  }
}

TEST(Dilate, GrowsByWholePixelsAtExactlyTheRadius) {
  const PixelGrid grid{PixelAxis(1, 100'000, 1000), PixelAxis(1, 100'000, 1000)};  // pixels of 1 um
  Image dot(21, std::vector<int>(21, 0));
  dot[10][10] = 1;
  Runs grown;
  dilate(runs_of(dot), reach_of(grid, 5000, 5000), grown);
  for (int r = 0; r < 21; ++r) {
    for (int c = 0; c < 21; ++c) {
      const int squared = (r - 10) * (r - 10) + (c - 10) * (c - 10);
      EXPECT_EQ(pixels_of(grown)[r][c], squared <= 25 ? 1 : 0) << r << " " << c;
    }
  }
  EXPECT_FALSE(grows_beyond(runs_of(dot), reach_of(grid, 10'000, 10'000)));
  EXPECT_TRUE(grows_beyond(runs_of(dot), reach_of(grid, 11'000, 11'000)));
  EXPECT_FALSE(grows_beyond(runs_of(dot), Reach()));
}

/// What a flood from outside over pixels that are not set does not reach.
Image flooded(const Image& image) {
  Image wide = with_border(image, 1);
  std::vector<std::pair<std::size_t, std::size_t>> todo{{0, 0}};
  wide[0][0] = 2;
  while (!todo.empty()) {
    const auto [r, c] = todo.back();
    todo.pop_back();
    for (const auto& [dr, dc] : {std::pair{0, 1}, {0, -1}, {1, 0}, {-1, 0}}) {
      const std::size_t nr = r + static_cast<std::size_t>(dr), nc = c + static_cast<std::size_t>(dc);
      if (nr >= wide.size() || nc >= wide[0].size() || wide[nr][nc] != 0) continue;
      wide[nr][nc] = 2;
      todo.emplace_back(nr, nc);
    }
  }
  Image filled = image;
  for (std::size_t r = 0; r < image.size(); ++r) {
    for (std::size_t c = 0; c < image[0].size(); ++c) filled[r][c] = wide[r + 1][c + 1] == 2 ? 0 : 1;
  }
  return filled;
}

TEST(Holes, AreWhatAFloodFromOutsideDoesNotReach) {
  Buffer<std::uint32_t> scratch;
  Runs filled;
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    Random random(seed);
    Image image = blots(random, 1 + random() % 60, 1 + random() % 40);
    if (seed % 3 == 0) {  // much finer: mazes
      for (auto& row : image) {
        for (int& pixel : row) pixel = random() % 100 < 55 ? 1 : 0;
      }
    }
    fill_holes(runs_of(image), scratch, filled);
    ASSERT_EQ(pixels_of(filled), flooded(image)) << "seed " << seed;
  }
}

TEST(Zones, KeepEveryPixelOfEveryImageAtItsLevel) {
  Random random(5);
  std::vector<Image> images(4, Image(30, std::vector<int>(50, 0)));
  Image level(30, std::vector<int>(50, 0));
  for (std::size_t r = 0; r < 30; ++r) {
    for (std::size_t c = 0; c < 50; ++c) {
      const std::uint32_t of = random() % 5;  // 4: in none
      if (of < 4) images[of][r][c] = 1, level[r][c] = static_cast<int>(of) + 1;
    }
  }
  std::vector<Runs> runs;
  for (const Image& image : images) runs.push_back(runs_of(image));
  std::vector<ZonePiece> scratch;
  Levels joined;
  join_zones(runs, scratch, joined);
  Image got(30, std::vector<int>(50, 0));
  const LevelsView view = joined.view();
  for (std::uint32_t r = 0; r < view.rows(); ++r) {
    for (std::uint32_t i = view.row_offset[r]; i < view.row_offset[r + 1]; ++i) {
      for (std::uint32_t c = view.change[2 * i]; c < view.change[2 * i + 1]; ++c) got[r][c] = view.level[i];
    }
  }
  EXPECT_EQ(got, level);
}

}  // namespace
}  // namespace lamina::dose
