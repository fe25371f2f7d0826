// Images as bits: the same files, pixels and counts as the same images as runs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "stages/data/bit_image.h"
#include "stages/data/levels.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "stages/formats/images/placed.h"
#include "stages/geometry/bits.h"
#include "stages/geometry/coverage.h"
#include "stages/raster/images.h"
#include "stages/support/io/file.h"
#include "stages/view/report/run_code.h"
#include "tests/commands/program.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

BitImage bits_of_runs(const Runs& runs) {
  BitImage image(runs.columns, runs.view().rows());
  for (std::uint32_t r = 0; r < image.rows(); ++r) add_runs(runs.view().row(r), image.row(r));
  return image;
}

Runs runs_of_bits(const BitRows& image) {
  RunsBuilder builder(image.columns());
  RowRuns rows(image);
  for (std::uint32_t r = 0; r < rows.rows(); ++r) builder.add_changes(rows.row(r));
  return builder.finish();
}

bool same_runs(const Runs& a, const Runs& b) {
  return a.columns == b.columns && a.row_offset == b.row_offset && a.change == b.change;
}

/// Images of many widths: empty, full, sparse and dense ones, and dithers with blank rows between.
std::vector<Runs> bit_samples() {
  std::mt19937 random(7);
  std::vector<Runs> images;
  for (const std::uint32_t columns : {1u, 7u, 8u, 63u, 64u, 65u, 127u, 128u, 200u, 1000u, 4099u}) {
    for (const std::uint32_t spacing : {1u, 2u, 9u, 300u}) {
      std::vector<testing::Row> rows;
      for (std::uint32_t r = 0; r < 60; ++r) {
        testing::Row row;
        if (r % 11 != 3 && (r < 20 || r > 34)) row = testing::random_row(random, columns, spacing);
        if (r % 13 == 5) row = {0, columns};
        if (r % 7 == 6) row = rows.back();
        if (r % 7 == 2) row = testing::neighbour(random, columns, row);
        rows.push_back(std::move(row));
      }
      images.push_back(testing::image_of(columns, rows));
    }
  }
  return images;
}

TEST(BitRows, FilesAreThoseOfRuns) {
  for (const Runs& runs : bit_samples()) {
    const BitImage bits = bits_of_runs(runs);
    for (const ImageFormat& format : image_formats()) {
      Bytes of_runs, of_bits;
      const auto encoder = format.make_encoder();
      ASSERT_TRUE(encoder->encode(runs.view(), 1200, 600, of_runs)) << format.id;
      ASSERT_TRUE(encoder->encode(bits, 1200, 600, of_bits)) << format.id;
      EXPECT_TRUE(of_runs == of_bits) << format.id << " " << runs.columns;
    }
  }
}

// Bands of rows meet within it, and files grow.
TEST(BitRows, LargeDitherGivesTheFilesOfItsRuns) {
  std::mt19937 random(3);
  std::vector<testing::Row> rows;
  for (std::uint32_t r = 0; r < 700; ++r) rows.push_back(r < 150 ? testing::Row() : testing::random_row(random, 3001, 1));
  const Runs runs = testing::image_of(3001, rows);
  const BitImage bits = bits_of_runs(runs);
  for (const char* id : {"tiff-g4", "png", "tiff-packbits"}) {
    Bytes of_runs, of_bits;
    ASSERT_TRUE(find_image_format(id)->make_encoder()->encode(runs.view(), 600, 600, of_runs));
    ASSERT_TRUE(find_image_format(id)->make_encoder()->encode(bits, 600, 600, of_bits));
    EXPECT_TRUE(of_runs == of_bits) << id;
  }
}

TEST(BitRows, GreyFilesAreThoseOfFullLevels) {
  const test::Directory folder;
  for (const Runs& runs : bit_samples()) {
    const BitImage bits = bits_of_runs(runs);
    Levels levels;
    levels_of(runs, 15, levels);
    for (const LevelFormat& format : level_formats()) {
      Bytes of_levels, of_bits;
      const auto encoder = format.make_encoder();
      ASSERT_TRUE(encoder->encode(levels.view(), 15, 1200, 600, of_levels)) << format.id;
      ASSERT_TRUE(encoder->encode(bits, 1200, 600, of_bits)) << format.id;
      EXPECT_TRUE(of_levels == of_bits) << format.id << " " << runs.columns;
    }
  }
}

TEST(BitRows, ImagesWithoutPixelsAreRefusedAsRunsAre) {
  Runs none;
  none.columns = 3;
  none.row_offset.assign(1, 0);
  for (const ImageFormat& format : image_formats()) {
    Bytes file;
    const Status of_runs = format.make_encoder()->encode(none.view(), 600, 600, file);
    const Status of_bits = format.make_encoder()->encode(BitImage(3, 0), 600, 600, file);
    ASSERT_EQ(of_runs.ok(), of_bits.ok()) << format.id;
    if (!of_runs.ok()) {
      EXPECT_EQ(of_runs.error().message, of_bits.error().message);
    }
  }
}

TEST(BitRows, ReadersKeepRunsBitsOrCounts) {
  const test::Directory folder;
  std::size_t as_bits = 0;
  for (const Runs& runs : bit_samples()) {
    for (const ImageFormat& format : image_formats()) {
      if (format.extension.empty()) continue;
      Bytes file;
      ASSERT_TRUE(format.make_encoder()->encode(runs.view(), 600, 600, file));
      const std::string path = folder / ("image" + std::string(format.extension));
      ASSERT_TRUE(write_file(path, file));
      for (const int threshold : {0, 128}) {
        const auto read = [&](Keep keep) { return threshold == 0 ? image(path, 0, keep) : dark_pixels(path, threshold, 0, keep); };
        const auto whole = read(Keep::kRuns), smaller = read(Keep::kSmaller), counts = read(Keep::kCounts);
        ASSERT_TRUE(whole.ok() && smaller.ok() && counts.ok()) << format.id;
        EXPECT_TRUE(same_runs(whole->runs, runs)) << format.id;
        EXPECT_FALSE(whole->bits);
        EXPECT_EQ(smaller->bits != nullptr, 8 * runs.change.size() > bytes_of_bits(runs.columns, 60)) << format.id;
        EXPECT_TRUE(same_runs(smaller->bits ? runs_of_bits(*smaller->bits) : smaller->runs, runs)) << format.id;
        EXPECT_TRUE(counts->runs.change.empty() && !counts->bits);
        EXPECT_EQ(counts->counts.changes, runs.change.size()) << format.id << " " << runs.columns;
        for (const auto* one : {&whole, &smaller, &counts}) {
          EXPECT_EQ((*one)->set(), set_pixels(runs)) << format.id;
          EXPECT_EQ((*one)->columns, runs.columns);
          EXPECT_EQ((*one)->rows, runs.view().rows());
        }
        as_bits += smaller->bits != nullptr;
      }
    }
  }
  EXPECT_GT(as_bits, 20u);
}

TEST(BitRows, AreCountedTurnedAndInvertedAsRunsAre) {
  for (const Runs& runs : bit_samples()) {
    const BitImage bits = bits_of_runs(runs);
    EXPECT_EQ(counts_of(bits).set, set_pixels(runs));
    EXPECT_EQ(counts_of(bits).changes, runs.change.size());
    EXPECT_TRUE(same_runs(runs_of_bits(bits), runs));
    for (const auto& [x, y] : {std::pair{true, false}, {false, true}, {true, true}}) {
      BitImage turned = bits;
      raster::mirror(turned, x, y);
      Runs expected;
      raster::mirror(runs.view(), x, y, expected);
      EXPECT_TRUE(same_runs(runs_of_bits(turned), expected)) << runs.columns << x << y;
    }
    BitImage turned = bits;
    invert(turned);
    EXPECT_TRUE(same_runs(runs_of_bits(turned), inverse(runs))) << runs.columns;
  }
}

TEST(BitRows, GreyIsCountedAsItsLevels) {
  const test::Directory folder;
  std::mt19937 random(11);
  for (const LevelFormat& format : level_formats()) {
    const std::uint8_t full = format.id == "tiff-4" ? 15 : 255;
    Levels image;
    image.start(203);
    for (std::uint32_t r = 0; r < 40; ++r) {
      for (std::uint32_t at = 0; at < 203;) {
        const std::uint32_t end = std::min(203u, at + 1 + testing::below(random, 9));
        image.append(at, end, static_cast<std::uint8_t>(testing::below(random, 3) == 0 ? full : testing::below(random, full + 1u)));
        at = end;
      }
      image.end_row();
    }
    Bytes file;
    ASSERT_TRUE(format.make_encoder()->encode(image.view(), full, 600, 600, file));
    const std::string path = folder / ("grey" + std::string(format.extension));
    ASSERT_TRUE(write_file(path, file));
    Levels read;
    ASSERT_TRUE(nearest_levels(path, {255}, read).ok());
    const auto counts = grey_counts(path, 0);
    ASSERT_TRUE(counts.ok()) << counts.error().message;
    EXPECT_EQ(counts->darkness, sum_of_levels(read)) << format.id;
    EXPECT_EQ(counts->between, pixels_at(read) - pixels_at(read, 255)) << format.id;
    EXPECT_GT(counts->between, 1000u);
  }
}

TEST(BitRows, AreDrawnAndPackedAsRunsAre) {
  for (const Runs& runs : bit_samples()) {
    const BitImage bits = bits_of_runs(runs);
    EXPECT_TRUE(view::report::pack_runs(runs) == view::report::pack_runs(bits));
    const PixelWindow window = window_of(runs), same = window_of(bits);
    EXPECT_EQ(window.left, same.left);
    EXPECT_EQ(window.right, same.right);
    EXPECT_EQ(window.top, same.top);
    EXPECT_EQ(window.bottom, same.bottom);
    if (window.empty()) continue;
    std::vector<std::uint8_t> of_runs(17 * 11), of_bits(17 * 11);
    box_coverage(runs, window, 17, of_runs);
    box_coverage(bits, window, 17, of_bits);
    EXPECT_EQ(of_runs, of_bits) << runs.columns;
  }
}

TEST(BitRows, ArePlacedAsRunsAre) {
  const PixelGrid grid{{600, 20'000'000}, {600, 10'000'000}};
  for (const Runs& runs : bit_samples()) {
    for (const double dpi : {600.0, 300.0, 1000.0}) {
      const Placement placement = placement_of(runs.columns, runs.view().rows(), pitch_of_dpi(dpi), pitch_of_dpi(600), grid, 5, 3);
      Runs expected;
      position(runs.view(), placement, expected);
      for (const Keep keep : {Keep::kRuns, Keep::kSmaller}) {
        RunsBuilder builder(grid.columns(), grid.rows(), keep);
        position(bits_of_runs(runs), placement, builder);
        const Runs found = builder.finish();
        const auto bits = builder.take_bits();
        EXPECT_TRUE(same_runs(bits ? runs_of_bits(*bits) : found, expected)) << runs.columns << " " << dpi;
      }
    }
  }
}

}  // namespace
}  // namespace lamina::formats
