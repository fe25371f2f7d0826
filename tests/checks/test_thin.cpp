// Thin places on runs against pixels one by one, and the law of widths: more of them find more.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "stages/checks/thin.h"
#include "tests/checks/volume.h"

namespace lamina::checks {
namespace {

using Pixel = std::pair<std::int64_t, std::int64_t>;  // column, row

PixelGrid square_grid(std::int64_t dpi_x, std::int64_t dpi_y) {
  return {PixelAxis(dpi_x, 10 * kNmPerMm), PixelAxis(dpi_y, 10 * kNmPerMm)};
}

/// Stencils of `pixels` columns.
Stencils stencils_of(const PixelGrid& grid, std::int64_t pixels) { return {grid, pixels * grid.x.span / grid.x.dots}; }

std::set<Pixel> pixels_of(const Stencil& stencil) {
  std::set<Pixel> pixels;
  for (std::size_t row = 0; row < stencil.rows.size(); ++row) {
    for (std::int64_t c = stencil.rows[row].first; c <= stencil.rows[row].last; ++c) {
      pixels.insert({c, static_cast<std::int64_t>(row)});
    }
  }
  return pixels;
}

Volume image_of(std::uint32_t columns, std::uint32_t rows) {
  return {columns, rows, 1, std::vector<std::uint8_t>(std::size_t{columns} * rows, 0)};
}

void fill(Volume& image, std::uint32_t left, std::uint32_t top, std::uint32_t wide, std::uint32_t high) {
  for (std::uint32_t r = top; r < std::min(image.rows, top + high); ++r) {
    for (std::uint32_t c = left; c < std::min(image.columns, left + wide); ++c) image.set[r * image.columns + c] = 1;
  }
}

/// Boxes, or noise of a share.
Volume random_image(std::mt19937& random, double share) {
  Volume image = image_of(40, 30);
  const auto draw = [&](std::uint32_t below) { return std::uniform_int_distribution<std::uint32_t>(0, below)(random); };
  for (int k = 0; share == 0 && k < 6; ++k) {
    const std::uint32_t left = draw(34), top = draw(24), wide = 1 + draw(14);
    fill(image, left, top, wide, 1 + draw(12));
  }
  for (auto& pixel : image.set) {
    if (std::uniform_real_distribution<>(0, 1)(random) < share) pixel = 1;
  }
  return image;
}

/// The pixels of an image that the stencil covers nowhere where it lies on set pixels alone.
std::set<Pixel> thin_for(const Volume& image, const std::set<Pixel>& stencil) {
  std::set<Pixel> thin;
  for (std::int64_t r = 0; r < image.rows; ++r) {
    for (std::int64_t c = 0; c < image.columns; ++c) {
      if (image.at(c, r, 0)) thin.insert({c, r});
    }
  }
  for (std::int64_t r = -40; r < image.rows; ++r) {
    for (std::int64_t c = -40; c < image.columns; ++c) {
      const bool fits = std::ranges::all_of(stencil, [&](const Pixel& at) { return image.at(c + at.first, r + at.second, 0); });
      for (const Pixel& at : stencil) {
        if (fits) thin.erase({c + at.first, r + at.second});
      }
    }
  }
  return thin;
}

/// Pieces of pixels that touch at sides or corners.
std::vector<std::set<Pixel>> pieces_of(std::set<Pixel> pixels) {
  std::vector<std::set<Pixel>> pieces;
  while (!pixels.empty()) {
    std::vector<Pixel> open{*pixels.begin()};
    pixels.erase(pixels.begin());
    std::set<Pixel>& piece = pieces.emplace_back(open.begin(), open.end());
    while (!open.empty()) {
      const Pixel at = open.back();
      open.pop_back();
      for (int k = 0; k < 9; ++k) {
        const Pixel next{at.first + k % 3 - 1, at.second + k / 3 - 1};
        if (pixels.erase(next) == 0) continue;
        piece.insert(next);
        open.push_back(next);
      }
    }
  }
  return pieces;
}

/// By the words of the page: for any width, pieces of more than two squares of it.
std::set<Pixel> reported_of(const Volume& image, const Stencils& stencils) {
  std::set<Pixel> reported;
  for (std::uint32_t k = 1; k < stencils.count(); ++k) {
    const Stencil stencil = stencils.at(k);
    for (const auto& piece : pieces_of(thin_for(image, pixels_of(stencil)))) {
      if (piece.size() > 2 * stencil.columns * stencil.rows.size()) reported.insert(piece.begin(), piece.end());
    }
  }
  return reported;
}

TEST(Stencils, AreAsWideAsRequestedAndMadeOfThoseBeforeThem) {
  const std::pair<int, int> dpi[] = {{254, 254}, {600, 300}, {300, 600}, {600, 400}, {600, 599}, {1200, 360}};
  for (const auto& [x, y] : dpi) {
    const PixelGrid grid = square_grid(x, y);
    const Stencils stencils(grid, 2'000'000);
    std::set<Pixel> before{{0, 0}};
    ASSERT_EQ(pixels_of(stencils.at(0)), before);
    for (std::uint32_t k = 1; k < stencils.count(); ++k) {
      const Stencil stencil = stencils.at(k);
      const std::set<Pixel> pixels = pixels_of(stencil);
      EXPECT_EQ(stencils.two_squares(k), 2 * stencil.columns * stencil.rows.size());
      // All of it is copies of the one before.
      std::set<Pixel> copies;
      for (std::int64_t r = 0; r < 3; ++r) {
        for (std::int64_t c = 0; c < 3; ++c) {
          std::set<Pixel> copy;
          for (const Pixel& at : before) copy.insert({at.first + c, at.second + r});
          if (std::ranges::includes(pixels, copy)) copies.insert(copy.begin(), copy.end());
        }
      }
      ASSERT_EQ(copies, pixels) << x << " " << y << " " << k;
      before = pixels;
    }
    const Stencil last = stencils.at(stencils.count() - 1);
    EXPECT_EQ(last.columns, std::ceil(2 * x / 25.4 - 1e-6));
    EXPECT_EQ(last.rows.size(), std::ceil(2 * y / 25.4 - 1e-6));
  }
  EXPECT_EQ(Stencils(square_grid(600, 600), nm_of(2 * 25.4 / 600)).count(), 2u) << "two pixels, rounded to a nanometre";
  EXPECT_EQ(Stencils(square_grid(600, 600), 0).count(), 1u);
  EXPECT_LE(Stencils(square_grid(1200, 1200), 1'000'000'000).count(), 480u) << "no wider than the image";
}

TEST(Stencils, AreRoundWherePixelsAreSquare) {
  const Stencils stencils = stencils_of(square_grid(254, 254), 40);
  for (std::uint32_t k = 4; k < stencils.count(); ++k) {
    double widest = 0, narrowest = 1e9;
    for (int degree = 0; degree < 180; degree += 5) {
      double low = 1e9, high = -1e9;
      for (const auto& [c, r] : pixels_of(stencils.at(k))) {
        const double along =
            static_cast<double>(c) * std::cos(degree * 0.0174533) + static_cast<double>(r) * std::sin(degree * 0.0174533);
        low = std::min(low, along);
        high = std::max(high, along);
      }
      widest = std::max(widest, high - low + 1);
      narrowest = std::min(narrowest, high - low + 1);
    }
    EXPECT_LE(widest, 1.09 * (k + 1) + 1) << k;
    EXPECT_GE(narrowest, (k + 1) - 0.5) << k;
  }
}

TEST(ThinRegions, AreThosePixelsThatAStencilCoversNowhere) {
  std::mt19937 random(7);
  ThinScratch scratch;
  for (const auto& [x, y] : {std::pair{254, 254}, {600, 300}, {600, 400}}) {
    const PixelGrid grid = square_grid(x, y);
    for (int turn = 0; turn < 24; ++turn) {
      const Volume image = random_image(random, turn % 3 == 0 ? 0 : 0.2 * (turn % 5));
      for (const std::int64_t wide : {2, 3, 5, 9}) {
        const Stencils stencils = stencils_of(grid, wide);
        const std::set<Pixel> reported = reported_of(image, stencils);
        const ThinRegions locations = thin_regions(image.layer(0), stencils, scratch);
        ASSERT_EQ(locations.pixels, reported.size()) << x << " " << y << " " << turn << " " << wide;
        std::vector<std::uint64_t> sizes, found;
        for (const auto& piece : pieces_of(reported)) sizes.push_back(piece.size());
        std::ranges::sort(sizes, std::greater());
        ASSERT_EQ(locations.count, sizes.size());
        sizes.resize(std::min(sizes.size(), ThinRegions::kMax));
        for (const ThinRegion& position : locations.largest) found.push_back(position.pixels);
        ASSERT_EQ(found, sizes);
      }
    }
  }
}

TEST(ThinRegions, AreFoundByEveryWiderMinimum) {
  std::mt19937 random(11);
  ThinScratch scratch;
  for (int turn = 0; turn < 200; ++turn) {
    const Volume image = random_image(random, turn % 2 == 0 ? 0 : 0.004 * turn);
    ThinRegions before;
    for (std::int64_t wide = 1; wide < 30; ++wide) {
      const ThinRegions locations = thin_regions(image.layer(0), stencils_of(square_grid(254, 254), wide), scratch);
      ASSERT_GE(locations.pixels, before.pixels) << turn << " " << wide;
      for (const ThinRegion& one : before.largest) {
        ASSERT_TRUE(std::ranges::any_of(locations.largest,
                                        [&](const ThinRegion& other) {
                                          return other.pixels >= one.pixels && other.box.left <= one.box.left &&
                                                 other.box.right >= one.box.right && other.box.top <= one.box.top &&
                                                 other.box.bottom >= one.box.bottom;
                                        }))
            << turn << " " << wide;
      }
      before = locations;
    }
  }
}

TEST(ThinRegions, WallsAreReportedFromTheWidthOnThatIsMore) {
  ThinScratch scratch;
  for (std::uint32_t wall = 1; wall < 16; ++wall) {
    Volume image = image_of(90, 90);
    fill(image, 10, 10, 40, 40);
    fill(image, 50, 20, 40, wall);  // a fin to the right
    for (std::uint32_t minimum = 1; minimum <= 32; ++minimum) {
      const ThinRegions locations = thin_regions(image.layer(0), stencils_of(square_grid(254, 254), minimum), scratch);
      EXPECT_EQ(locations.count, minimum > wall ? 1u : 0u) << wall << " " << minimum;
      for (const ThinRegion& position : locations.largest) EXPECT_EQ(position.box.right, 90u);
    }
  }
}

// At any angle: of a block turned about, corners are no thin places, and its fin is where it is thinner than a least wall.
TEST(ThinRegions, OfTurnedBodiesAreTheirFins) {
  const PixelGrid grid = square_grid(508, 508);  // pixels of 50 um
  ThinScratch scratch;
  for (int degree = 0; degree < 90; degree += 5) {
    Volume image = image_of(200, 200);
    for (std::int64_t r = 0; r < 200; ++r) {
      for (std::int64_t c = 0; c < 200; ++c) {
        const double x = static_cast<double>(c) - 99.5, y = static_cast<double>(r) - 99.5, turn = degree * 0.01745329252;
        const double u = x * std::cos(turn) + y * std::sin(turn), v = y * std::cos(turn) - x * std::sin(turn);
        const bool block = std::abs(u) < 40 && std::abs(v) < 40, fin = u >= 40 && u < 90 && std::abs(v) < 5;
        image.set[static_cast<std::size_t>(r * 200 + c)] = block || fin ? 1 : 0;
      }
    }
    for (const std::int64_t minimum : {2, 4, 6, 8, 12, 16, 24, 32}) {
      const ThinRegions locations = thin_regions(image.layer(0), stencils_of(grid, minimum), scratch);
      EXPECT_EQ(locations.count, minimum > 10 ? 1u : 0u) << degree << " " << minimum;
    }
  }
}

}  // namespace
}  // namespace lamina::checks
