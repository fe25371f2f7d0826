// tests/calibration/scan/test_compare.cpp: layers compared with synthetic images. LAMINA_LAYERS=1000 measures the figures of
// docs/howto/compare_photographs.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

#include "stages/calibration/scan/compare.h"
#include "stages/calibration/scan/photo.h"
#include "stages/data/machine.h"
#include "stages/data/program.h"
#include "stages/data/runs.h"
#include "stages/program/head_grid.h"
#include "tests/calibration/scan/synthetic.h"

namespace lamina::test {
namespace {

/// Blobs with holes, 6 to 20 mm wide, on the bed of the default machine.
Runs random_layer(const HeadGrid& grid, std::mt19937_64& random) {
  const auto between = [&](double minimum, double maximum) {
    return std::uniform_real_distribution<double>(minimum, maximum)(random);
  };
  struct Blob {
    double x, y, r, lobes, phase, depth, hole;
  };
  std::vector<Blob> blobs;
  for (int i = std::uniform_int_distribution<int>(2, 6)(random); i > 0; --i)
    blobs.push_back({between(25, 70), between(25, 70), between(4, 10), std::floor(between(2, 6)), between(0, 6),
                     between(0, 0.4), between(0, 0.5)});
  const double pixel = grid.position_nm * 1e-6;
  Runs layer;
  layer.columns = grid.image.columns();
  layer.row_offset.push_back(0);
  for (std::uint32_t r = 0; r < grid.image.rows(); ++r) {
    bool on = false;
    for (std::uint32_t c = 0; c <= layer.columns; ++c) {
      bool set = false;
      for (const Blob& b : blobs) {
        const double x = (c + 0.5) * pixel - b.x, y = (r + 0.5) * pixel - b.y, d = std::hypot(x, y);
        const double edge = b.r * (1 + b.depth * std::sin(b.lobes * std::atan2(y, x) + b.phase));
        set = set || (d < edge && d > b.hole * b.r);
      }
      set = set && c < layer.columns;
      if (set != on) layer.change.push_back(c);
      on = set;
    }
    layer.row_offset.push_back(static_cast<std::uint32_t>(layer.change.size()));
  }
  return layer;
}

TEST(ComparedLayer, MissingSwathsAreFoundAndNoneIsMadeUp) {
  const char* requested = std::getenv("LAMINA_LAYERS");
  const int layers = requested == nullptr ? 6 : std::atoi(requested);
  Machine machine;
  machine.name = "along x";
  machine.mounting.tilt_deg = 45;
  const auto grid = program::make_head_grid(machine);
  ASSERT_TRUE(grid);
  std::size_t unread = 0, missing = 0, found = 0, wrong = 0, extra = 0;
  std::vector<double> area;
  for (int i = 0; i < layers; ++i) {
    std::mt19937_64 random(static_cast<std::uint64_t>(i) * 104'729 + 7);
    const auto between = [&](double minimum, double maximum) {
      return std::uniform_real_distribution<double>(minimum, maximum)(random);
    };
    const Runs layer = random_layer(*grid, random);
    // Three lines of 97 um: 0.3 mm of a swath, where at least 5 mm are to be printed; every other layer lacks nothing.
    std::uint32_t gap = UINT32_MAX;
    if (i % 2 == 0) {
      do gap = std::uniform_int_distribution<std::uint32_t>(0, layer.view().rows() - 4)(random);
      while ([&] {
        std::uint64_t minimum = UINT64_MAX;
        for (std::uint32_t r = gap - std::min(gap, 12u); r < std::min(gap + 15, layer.view().rows()); ++r) {
          std::uint64_t set = 0;
          for (std::size_t k = 0; k + 1 < layer.view().row(r).size(); k += 2)
            set += layer.view().row(r)[k + 1] - layer.view().row(r)[k];
          minimum = std::min(minimum, set);
        }
        return minimum < 60;
      }());
    }
    Printing printing;
    printing.gain_um = between(0, 30);
    printing.skips = [&](std::uint32_t line) { return line >= gap && line < gap + 3; };
    Camera camera{.pixels_a_mm = between(9.8, 10.2),
                  .turn_deg = between(-180, 180),
                  .tilt_x = between(-0.02, 0.02),
                  .tilt_y = between(-0.02, 0.02),
                  .margin_mm = between(3, 8),
                  .blur_pixels = between(0.5, 1.1),
                  .noise = between(1, 5),
                  .paper = between(0.6, 0.85),
                  .ink = between(0.1, 0.4),
                  .shade_x = between(-0.2, 0.2),
                  .shade_y = between(-0.2, 0.2),
                  .vignette = between(0, 0.15),
                  .dark_specks = std::uniform_int_distribution<std::uint32_t>(0, 30)(random),
                  .bright_specks = std::uniform_int_distribution<std::uint32_t>(0, 15)(random)};
    const GreyPicture picture = photograph(print_sheet(*grid, layer, printing), camera, random);
    cv::Mat grey(picture.height, picture.width, CV_8U);
    for (int y = 0; y < picture.height; ++y)
      std::memcpy(grey.ptr(y), picture.grey.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width),
                  static_cast<std::size_t>(picture.width));
    const auto detected = calibration::compare_layer(calibration::photo_of(std::move(grey)),
                                                     {layer.view(), grid->position_nm, grid->line_nm, true, 100});
    missing += gap != UINT32_MAX;
    if (!detected) {
      ++unread;
      ADD_FAILURE() << "layer " << i << ": " << detected.error().message;
      continue;
    }
    EXPECT_NEAR(std::remainder(detected->position.rotation_deg - camera.turn_deg, 360), 0, 1) << "layer " << i;
    const double at = (gap + 1.5) * grid->line_nm * 1e-6;
    bool hit = false;
    for (const calibration::MissingBand& band : detected->bands) {
      const bool here = gap != UINT32_MAX && band.from_mm - 0.2 < at && at < band.to_mm + 0.2;
      hit = hit || here;
      wrong += !here;
    }
    found += hit;
    if (requested != nullptr && (hit != (gap != UINT32_MAX) || detected->bands.size() > 1))
      printf("layer %d: %zu bands, gap %u, likeness %.3f, ink %.2f, turn %.2f\n", i, detected->bands.size(), gap,
             detected->position.likeness, camera.ink, camera.turn_deg);
    extra += detected->extra.size();
    if (gap == UINT32_MAX) {
      double expected = 0, got = 0;
      for (const calibration::BodyReading& body : detected->bodies) expected += body.expected_mm2, got += body.detected_mm2;
      area.push_back(std::abs(got / expected - 1));
    }
  }
  std::ranges::sort(area);
  printf(
      "%d layers, %zu not read: %zu of %zu swaths missing by 0.3 mm found, %zu reported wrongly; area of whole layers: half within %.1f %%, all within %.1f %%\n",
      layers, unread, found, missing, wrong, area.empty() ? 0 : 100 * area[area.size() / 2],
      area.empty() ? 0 : 100 * area.back());
  EXPECT_GE(static_cast<double>(found), 0.95 * static_cast<double>(missing));
  EXPECT_EQ(wrong, 0u);
  EXPECT_EQ(extra, 0u);
}

/// A sheet of squares and an L, photographed; the layer has some of it.
struct SheetOfBlocks {
  explicit SheetOfBlocks(bool all) {
    machine.name = "along x";
    machine.mounting.tilt_deg = 45;
    const auto made = program::make_head_grid(machine);
    EXPECT_TRUE(made);
    grid = *made;
    const double x_mm = grid.position_nm * 1e-6, y_mm = grid.line_nm * 1e-6;
    layer.columns = grid.image.columns();
    layer.row_offset.push_back(0);
    for (std::uint32_t r = 0; r < grid.image.rows(); ++r) {
      bool on = false;
      for (std::uint32_t c = 0; c <= layer.columns; ++c) {
        const double x = c * x_mm, y = r * y_mm;
        const auto within = [&](double left, double top, double wide, double deep) {
          return x >= left && x < left + wide && y >= top && y < top + deep;
        };
        const bool set = c < layer.columns && (within(30, 40, 12, 4) || within(30, 40, 4, 16) ||
                                               (all && (within(50, 40, 6, 6) || within(52, 60, 3, 3))));
        if (set != on) layer.change.push_back(c);
        on = set;
      }
      layer.row_offset.push_back(static_cast<std::uint32_t>(layer.change.size()));
    }
  }
  Machine machine;
  HeadGrid grid;
  Runs layer;
};

cv::Mat grey_of_blocks(const SheetOfBlocks& sheet, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const Camera camera{.pixels_a_mm = 10,
                      .turn_deg = 2,
                      .tilt_x = 0.01,
                      .noise = 4,
                      .shade_x = 0.15,
                      .shade_y = -0.15,
                      .dark_specks = 40,
                      .bright_specks = 10};
  Printing printing;
  printing.gain_um = 10;
  const GreyPicture picture = photograph(print_sheet(sheet.grid, sheet.layer, printing), camera, random);
  cv::Mat grey(picture.height, picture.width, CV_8U);
  std::memcpy(grey.data, picture.grey.data(), picture.grey.size());
  return grey;
}

Result<calibration::Comparison> compare_blocks(const SheetOfBlocks& sheet, const cv::Mat& grey) {
  return calibration::compare_layer(calibration::photo_of(grey.clone()),
                                    {sheet.layer.view(), sheet.grid.position_nm, sheet.grid.line_nm, true, 100});
}

TEST(ComparedLayer, InkWhereTheLayerHasNoneIsReported) {
  const SheetOfBlocks all(true), one(false);
  const cv::Mat grey = grey_of_blocks(all, 1);
  const auto detected = compare_blocks(one, grey);
  ASSERT_TRUE(detected) << detected.error().message;
  ASSERT_EQ(detected->extra.size(), 2u);
  EXPECT_NEAR(detected->extra[0].x_mm, 53, 0.3);
  EXPECT_NEAR(detected->extra[0].y_mm, 43, 0.3);
  EXPECT_NEAR(detected->extra[0].mm2, 36, 3);
  EXPECT_NEAR(detected->extra[1].mm2, 9, 1);
  const auto whole = compare_blocks(all, grey);
  ASSERT_TRUE(whole) << whole.error().message;
  EXPECT_TRUE(whole->extra.empty());
}

TEST(ComparedLayer, AnotherLayerIsRefused) {
  const SheetOfBlocks all(true);
  SheetOfBlocks other(true);
  std::mt19937_64 random(3);
  other.layer = random_layer(other.grid, random);
  const auto refused = compare_blocks(other, grey_of_blocks(all, 1));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::kInput);
  EXPECT_NE(refused.error().message.find("does not show the layer (correlation 0."), std::string::npos)
      << refused.error().message;
}

/// A bar looks the same upside down: the smaller rotation is taken, the other one is reported.
TEST(ComparedLayer, ASymmetricLayerNamesItsOtherRotation) {
  SheetOfBlocks bar(false);
  bar.layer = {bar.layer.columns, {0}, {}};
  for (std::uint32_t r = 0; r < bar.grid.image.rows(); ++r) {
    if (r >= 400 && r < 500) bar.layer.change.insert(bar.layer.change.end(), {300, 550});
    bar.layer.row_offset.push_back(static_cast<std::uint32_t>(bar.layer.change.size()));
  }
  const auto detected = compare_blocks(bar, grey_of_blocks(bar, 4));
  ASSERT_TRUE(detected) << detected.error().message;
  EXPECT_NEAR(detected->position.rotation_deg, 2, 0.5);
  ASSERT_EQ(detected->position.also_deg.size(), 1u);
  EXPECT_NEAR(detected->position.also_deg[0], -178, 0.5);
  const SheetOfBlocks all(true);
  const auto unique = compare_blocks(all, grey_of_blocks(all, 4));
  ASSERT_TRUE(unique) << unique.error().message;
  EXPECT_TRUE(unique->position.also_deg.empty());
}

/// Eight in nine pixels are blank: nothing is printed in full.
TEST(ComparedLayer, ALayerOfStrewnDropsIsRefusedForItself) {
  const SheetOfBlocks one(false);
  SheetOfBlocks strewn = one;
  strewn.layer = {one.layer.columns, {0}, {}};
  for (std::uint32_t r = 0; r < one.layer.view().rows(); ++r) {
    const auto row = one.layer.view().row(r);
    for (std::size_t i = 0; r % 3 == 0 && i + 1 < row.size(); i += 2) {
      for (std::uint32_t c = row[i]; c < row[i + 1]; c += 3) strewn.layer.change.insert(strewn.layer.change.end(), {c, c + 1});
    }
    strewn.layer.row_offset.push_back(static_cast<std::uint32_t>(strewn.layer.change.size()));
  }
  const auto refused = compare_blocks(strewn, grey_of_blocks(strewn, 3));
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("without --saturation"), std::string::npos) << refused.error().message;
}

TEST(ComparedLayer, AMirroredPhotographIsRefused) {
  const SheetOfBlocks all(true), one(false);
  for (const SheetOfBlocks* sheet : {&all, &one}) {
    const cv::Mat grey = grey_of_blocks(*sheet, 2);
    EXPECT_TRUE(compare_blocks(*sheet, grey));
    for (const bool upside : {false, true}) {
      cv::Mat mirrored(grey.rows, grey.cols, CV_8U);
      for (int y = 0; y < grey.rows; ++y) {
        for (int x = 0; x < grey.cols; ++x)
          mirrored.at<std::uint8_t>(y, x) =
              upside ? grey.at<std::uint8_t>(grey.rows - 1 - y, x) : grey.at<std::uint8_t>(y, grey.cols - 1 - x);
      }
      const auto refused = compare_blocks(*sheet, mirrored);
      ASSERT_FALSE(refused);
      EXPECT_NE(refused.error().message.find("is a mirror image"), std::string::npos) << refused.error().message;
    }
  }
}

}  // namespace
}  // namespace lamina::test
