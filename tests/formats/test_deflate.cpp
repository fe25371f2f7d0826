// TIFF of deflate for dithered images: libtiff and zlib read what is written, of runs as of rows made on demand.
#include <gtest/gtest.h>
#include <zlib.h>

#include <bit>
#include <random>

#include "stages/dose/dither.h"
#include "stages/formats/images/image.h"
#include "stages/formats/tiff/dither_deflate.h"
#include "stages/geometry/drop_rows.h"
#include "stages/geometry/run_rows.h"
#include "tests/formats/images.h"

namespace lamina {
namespace {

/// A disc, dithered to a fraction of its pixels by blue noise, or by the pattern of a core.
Runs dithered_disc(std::uint32_t columns, std::uint32_t rows, double fraction, bool core) {
  std::vector<formats::testing::Row> disc;
  for (std::uint32_t r = 0; r < rows; ++r) {
    const double y = (r + 0.5) / rows * 2 - 1, half = std::sqrt(1 - y * y) * columns / 2;
    const auto begin = static_cast<std::uint32_t>(columns / 2.0 - half), end = static_cast<std::uint32_t>(columns / 2.0 + half);
    disc.push_back(begin < end ? formats::testing::Row{begin, end} : formats::testing::Row{});
  }
  const Runs image = formats::testing::image_of(columns, disc);
  const dose::Drops24 drops[] = {0, static_cast<dose::Drops24>(fraction * (1 << dose::kDropBits))};
  DropPatterns patterns;
  core ? dose::make_core(fraction, 3, patterns) : dose::make_zones(drops, 3, patterns);
  Levels zones;
  levels_of(image, core ? 2 : 1, zones);
  Runs result;
  runs_of({zones.view(), &patterns}, 0, result);
  return result;
}

std::string expanded(std::span<const std::byte> stream, std::size_t bytes) {
  std::string out(bytes + 1, '\0');
  uLongf length = out.size();
  EXPECT_EQ(
      uncompress(reinterpret_cast<Bytef*>(out.data()), &length, reinterpret_cast<const Bytef*>(stream.data()), stream.size()),
      Z_OK);
  out.resize(length);
  return out;
}

TEST(DitherDeflate, AnyBytesComeBackWithinTheBound) {
  std::mt19937 random(5);
  formats::tiff::DitherDeflate deflate;
  for (std::size_t bytes : {1u, 7u, 15u, 16u, 17u, 31u, 40u, 273u, 274u, 275u, 276u, 5000u, 262'144u}) {
    for (int kind = 0; kind < 6; ++kind) {
      std::string text(bytes, '\0');
      for (std::size_t i = 0; i < bytes; ++i) {
        const auto noise = static_cast<char>(random());
        text[i] = kind == 0   ? '\0'
                  : kind == 1 ? noise
                  : kind == 2 ? (i < 16 || random() % 50 == 0 ? noise : text[i - 16])
                  : kind == 3 ? static_cast<char>(std::countl_zero(static_cast<std::uint32_t>(random() | 1)))  // skewed
                  : kind == 4 ? (i % 600 < 300 ? noise : '\0')
                              : '\xFF';
      }
      std::vector<std::byte> out(formats::tiff::StripCode::bound(bytes) + 16, std::byte{0xA5});
      std::vector<RowSpan> set{{0, bytes}};
      if (kind == 4) {
        set.clear();
        for (std::size_t at = 0; at < bytes; at += 600) set.push_back({at, std::min(bytes, at + 300)});
      }
      const std::size_t made = deflate.compress(std::as_bytes(std::span(text)), 41, set, out.data());
      ASSERT_LE(made, formats::tiff::StripCode::bound(bytes));
      EXPECT_EQ(out[formats::tiff::StripCode::bound(bytes)], std::byte{0xA5});
      EXPECT_TRUE(expanded(std::span(out).first(made), bytes) == text) << bytes << " bytes of kind " << kind;
    }
  }
}

TEST(StripMatches, LongRunsOfEqualBytesComeFirstAndThenDistancesInTheirOrder) {
  using formats::tiff::StripPiece;
  std::vector<std::byte> strip(400, std::byte{0});
  for (std::size_t i = 100; i < 160; ++i) strip[i] = static_cast<std::byte>(i % 20 + 1);  // repeats at 20 from 120 on
  for (std::size_t i = 160; i < 165; ++i) strip[i] = std::byte{255};
  formats::tiff::StripCode code;
  for (const std::size_t distance : {1u, 20u}) code.add_distance(distance);
  formats::tiff::StripMatches matches;
  Buffer<StripPiece> pieces;
  EXPECT_EQ(matches.add({strip, code.distances(), 0, 200}, 0, pieces), 200u);
  EXPECT_EQ(matches.add({strip, code.distances(), 200, 400}, 200, pieces), 400u);
  const auto expected = std::to_array<StripPiece>({{1, 99, 0}, {20, 40, 1}, {1, 4, 0}, {1, 234, 0}});
  ASSERT_EQ(pieces.size(), expected.size());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(pieces[i].literals, expected[i].literals) << i;
    EXPECT_EQ(pieces[i].match, expected[i].match) << i;
    EXPECT_EQ(pieces[i].distance, expected[i].distance) << i;
  }
}

TEST(DitherDeflate, DitheredImagesAreReadAgainAndSmall) {
  const auto* format = formats::find_image_format("tiff-deflate");
  ASSERT_NE(format, nullptr);
  const formats::testing::Folder folder;
  for (const std::uint32_t columns : {1u, 64u, 129u, 3001u}) {
    for (const bool core : {false, true}) {
      const Runs runs = dithered_disc(columns, 1000, 0.62, core);
      const auto encoder = format->make_encoder();
      formats::Bytes file, of_rows, g4;
      ASSERT_TRUE(encoder->encode(runs, 600, 300, file).ok());
      ASSERT_TRUE(encoder->encode(RunRows(runs), 600, 300, of_rows).ok());
      EXPECT_TRUE(file == of_rows) << columns;
      formats::testing::save(folder / "layer.tif", file);
      const auto image = formats::image(folder / "layer.tif");
      ASSERT_TRUE(image.ok()) << image.error().message;
      EXPECT_EQ(image->dpi_x, 600);
      EXPECT_EQ(image->dpi_y, 300);
      EXPECT_TRUE(image->runs.row_offset == runs.row_offset && image->runs.change == runs.change) << columns << core;
      if (columns < 3000) continue;
      ASSERT_TRUE(formats::find_image_format("tiff-g4")->make_encoder()->encode(runs, 600, 300, g4).ok());
      EXPECT_LT(file.size(), g4.size() / (core ? 12 : 6));
    }
  }
}

/// A disc of full voxels with edges of levels 1 and 2 of 3 in between, and a row of all kinds of words.
Levels disc_of_levels(std::uint32_t columns, std::uint32_t rows, std::mt19937& random) {
  Levels zones;
  zones.start(columns);
  for (std::uint32_t r = 0; r < rows; ++r) {
    const double y = (r + 0.5) / rows * 2 - 1, half = std::sqrt(1 - y * y) * columns / 2;
    auto at = static_cast<std::uint32_t>(columns / 2.0 - half);
    const auto end = static_cast<std::uint32_t>(columns / 2.0 + half);
    while (at < end && r % 7 != 3) {
      const std::uint32_t lengths[] = {1, 3, 9, 64, 200, 700}, stop = std::min(end, at + lengths[random() % 6]);
      zones.append(at, stop, static_cast<std::uint8_t>(random() % 3 == 0 ? random() % 4 : 3));
      at = stop;
    }
    zones.end_row();
  }
  return zones;
}

TEST(EdgeDeflate, ImagesWhoseEdgesAloneAreDitheredAreReadAgainAndSmall) {
  const auto* format = formats::find_image_format("tiff-deflate");
  const formats::testing::Folder folder;
  const dose::Drops24 one = dose::kOneDrop, drops[] = {0, one / 3, 2 * one / 3, one};
  DropPatterns patterns;
  dose::make_zones(drops, 3, patterns);
  std::mt19937 random(3);
  for (const std::uint32_t columns : {1u, 64u, 129u, 511u, 512u, 3001u, 9000u}) {
    const Levels zones = disc_of_levels(columns, 1200, random);
    Runs runs;
    runs_of({zones.view(), &patterns}, 0, runs);
    const auto encoder = format->make_encoder();
    formats::Bytes plain, file;
    ASSERT_TRUE(encoder->encode(DropPlane({zones.view(), &patterns}, 0), 600, 300, plain).ok());
    patterns.edges_alone = true;
    for (int turn = 0; turn < 2; ++turn) {
      ASSERT_TRUE(encoder->encode(DropPlane({zones.view(), &patterns}, 0), 600, 300, file).ok());
      formats::testing::save(folder / "layer.tif", file);
      const auto image = formats::image(folder / "layer.tif");
      ASSERT_TRUE(image.ok()) << image.error().message;
      EXPECT_TRUE(image->runs.row_offset == runs.row_offset && image->runs.change == runs.change) << columns;
      EXPECT_LE(file.size(), format->max_bytes(columns, 1200, runs.change.size()));
    }
    patterns.edges_alone = false;
    if (columns > 3000) {
      const std::size_t raw = std::size_t{columns} * 1200 / 8;
      EXPECT_LT(plain.size(), raw / 13);
      EXPECT_LT(file.size(), raw / 11);
      EXPECT_LT(file.size(), plain.size() * 5 / 4);  // the price of a cost that depends on edges alone: 18 and 20 %
    }
  }
}

TEST(EdgeDeflate, SpansOfARowAreItsWordsThatAreNotEmpty) {
  const dose::Drops24 drops[] = {0, dose::kOneDrop / 2, dose::kOneDrop};
  DropPatterns patterns;
  dose::make_zones(drops, 0, patterns);
  Levels zones;
  zones.start(700);
  zones.append(60, 64, 2), zones.append(64, 320, 2), zones.append(321, 322, 2), zones.append(400, 560, 1),
      zones.append(640, 700, 2);
  zones.end_row();
  const DropPlane plane({zones.view(), &patterns}, 0);
  WordSpans spans;
  plane.spans(0, spans);
  ASSERT_EQ(spans.span.size(), 4u);  // word 0; words 1 to 4, which are full; 5 to 8; 10
  EXPECT_EQ(spans.span[0].end, 1u);
  EXPECT_TRUE(spans.span[1].first == 1 && spans.span[1].end == 5 && spans.span[1].full);
  EXPECT_TRUE(spans.span[2].first == 5 && spans.span[2].end == 9 && !spans.span[2].full);
  ASSERT_EQ(spans.mixed.size(), 6u);
  EXPECT_EQ(spans.mixed[0], std::uint64_t{0xF} << 60);
  EXPECT_EQ(spans.mixed[1], 2u);
  EXPECT_EQ(spans.mixed.back(), (std::uint64_t{1} << 60) - 1);
  std::vector<std::uint64_t> words(plane.words());
  plane.row(0, words);
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(spans.mixed[1 + i], words[5 + i]);
}

TEST(DitherDeflate, FormatsWithoutBitsOfTheirOwnEncodeRowsAsRuns) {
  const Runs runs = dithered_disc(700, 90, 0.3, false);
  for (const formats::ImageFormat& format : formats::image_formats()) {
    const auto encoder = format.make_encoder();
    formats::Bytes of_runs, of_rows;
    ASSERT_TRUE(encoder->encode(runs, 600, 600, of_runs).ok());
    ASSERT_TRUE(encoder->encode(RunRows(runs), 600, 600, of_rows).ok());
    EXPECT_TRUE(of_runs == of_rows) << format.id;
  }
}

}  // namespace
}  // namespace lamina
