// Every format, read back, is the runs it was made of.
#include <gtest/gtest.h>
#include <tiffio.h>

#include <algorithm>
#include <array>

#include "stages/formats/g4/encode.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/bits.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

using testing::Row;

::testing::AssertionResult same(const formats::Image& image, const Runs& runs) {
  if (image.runs.columns != runs.columns) return ::testing::AssertionFailure() << image.runs.columns << " columns";
  if (image.runs.row_offset.size() != runs.row_offset.size()) {
    return ::testing::AssertionFailure() << image.runs.row_offset.size() << " offsets";
  }
  for (std::uint32_t r = 0; r < runs.view().rows(); ++r) {
    const auto got = image.runs.view().row(r), want = runs.view().row(r);
    if (!std::equal(got.begin(), got.end(), want.begin(), want.end())) {
      return ::testing::AssertionFailure() << "row " << r << " of " << runs.view().rows() << " differs";
    }
  }
  return ::testing::AssertionSuccess();
}

void expect_round_trip(const testing::Folder& folder, const Runs& runs, const std::string& what) {
  for (const ImageFormat* format : testing::file_formats()) {
    SCOPED_TRACE(std::string(format->id) + ", " + what);
    const std::string path = folder / ("image" + std::string(format->extension));
    const Bytes file = testing::encoded(*format, runs);
    ASSERT_FALSE(file.empty());
    testing::save(path, file);
    const auto image = formats::image(path);
    ASSERT_TRUE(image.ok()) << image.error().message;
    ASSERT_TRUE(same(*image, runs));
    EXPECT_NEAR(image->dpi_x, 1200, 0.02);  // PNG has whole pixels a metre
    EXPECT_NEAR(image->dpi_y, 600, 0.02);
  }
}

TEST(ImageFormats, EveryFormatGivesRandomImagesBackAtEveryWidthUpToSeventy) {
  const testing::Folder folder;
  for (std::uint32_t columns = 1; columns <= 70; ++columns) {
    expect_round_trip(folder, testing::random_image(columns, columns, 40), std::to_string(columns) + " columns");
  }
}

TEST(ImageFormats, EveryFormatGivesWideImagesBack) {
  const testing::Folder folder;
  for (const std::uint32_t columns : {127u, 128u, 1791u, 1793u, 2559u, 2560u, 2561u, 2562u, 2623u, 2624u, 2625u, 5120u, 5183u,
                                      5184u, 10007u, 18898u, 70000u}) {
    expect_round_trip(folder, testing::random_image(columns, columns, 25), std::to_string(columns) + " columns");
  }
}

TEST(ImageFormats, PlainImagesComeBack) {
  const testing::Folder folder;
  for (const std::uint32_t columns : {1u, 7u, 8u, 9u, 63u, 64u, 65u, 2561u}) {
    Row odd, even;
    for (std::uint32_t column = 0; column + 1 <= columns; column += 2) even.insert(even.end(), {column, column + 1});
    for (std::uint32_t column = 1; column + 1 <= columns; column += 2) odd.insert(odd.end(), {column, column + 1});
    const Row full{0, columns}, left{0, 1}, right{columns - 1, columns}, none;
    const std::string what = std::to_string(columns) + " columns";
    for (const std::uint32_t rows : {1u, 2u, 9u, 500u}) {
      expect_round_trip(folder, testing::image_of(columns, std::vector<Row>(rows, none)), what + " white");
      expect_round_trip(folder, testing::image_of(columns, std::vector<Row>(rows, full)), what + " black");
      expect_round_trip(folder, testing::image_of(columns, std::vector<Row>(rows, even)), what + " stripes");
    }
    expect_round_trip(folder, testing::image_of(columns, {even, odd, even, odd}), what + " chequered");
    expect_round_trip(folder, testing::image_of(columns, {left, right, left, full, right, none, left, even, none}),
                      what + " sides");
  }
}

TEST(ImageFormats, AnEncoderUsedAgainWritesTheBytesOfANewOne) {
  for (const ImageFormat* format : testing::file_formats()) {
    const auto encoder = format->make_encoder();
    Bytes file;
    for (const std::uint32_t columns : {3000u, 11u, 300u, 1u, 3000u}) {
      const Runs runs = testing::random_image(columns, columns, 60);
      ASSERT_TRUE(encoder->encode(runs, 1200, 600, file).ok());
      EXPECT_EQ(file, testing::encoded(*format, runs)) << format->id << " " << columns;
    }
  }
}

TEST(ImageFormats, AnImageWithoutPixelsOrOfImpossibleSizeIsAnErrorAndNotAFile) {
  for (const ImageFormat* format : testing::file_formats()) {
    if (format->id == "pbm") continue;  // has no limit
    Bytes file;
    const Runs none = testing::image_of(0, {{}, {}}), wide = testing::image_of(kMaxPixelsASide + 1, {{}});
    EXPECT_FALSE(format->make_encoder()->encode(none, 600, 600, file).ok()) << format->id;
    EXPECT_FALSE(format->make_encoder()->encode(testing::image_of(5, {}), 600, 600, file).ok()) << format->id;
    EXPECT_FALSE(format->make_encoder()->encode(wide, 600, 600, file).ok()) << format->id;
  }
}

TEST(ImageFormats, AnUncompressedTiffBeyondFourGigabytesIsRefusedBeforeItIsMade) {
  Runs runs;
  runs.columns = 200'000;
  runs.row_offset.resize(200'001);
  std::fill(runs.row_offset.begin(), runs.row_offset.end(), 0);
  Bytes file;
  const Status status = find_image_format("tiff-none")->make_encoder()->encode(runs, 25400, 25400, file);
  ASSERT_FALSE(status.ok());
  EXPECT_EQ(status.error().fault, Fault::kOutput);
  EXPECT_NE(status.error().message.find("tiff-g4"), std::string::npos) << status.error().message;
  EXPECT_TRUE(find_image_format("tiff-g4")->make_encoder()->encode(runs, 25400, 25400, file).ok());
}

TEST(ImageFormats, TheRegistryBeginsWithG4AndFindsEachFormatByItsId) {
  EXPECT_EQ(image_formats().front().id, "tiff-g4");
  for (const ImageFormat& format : image_formats()) EXPECT_EQ(find_image_format(format.id), &format);
  EXPECT_EQ(find_image_format("tiff"), nullptr);
  EXPECT_TRUE(find_image_format("null")->extension.empty());
}

// --- the code tables, by libtiff

TEST(G4, ARunOfEveryLengthInBothColoursComesBack) {
  const testing::Folder folder;
  // Lengths at which another make-up code or one more begins, and all others up to the end of the tables.
  std::vector<std::uint32_t> lengths;
  for (std::uint32_t length = 1; length <= 5300; ++length) lengths.push_back(length);
  for (const std::uint32_t length : {7679u, 7680u, 7681u, 10239u, 10240u, 10241u, 12800u, 20479u, 20480u})
    lengths.push_back(length);
  const std::uint32_t columns = 41000;
  std::vector<Row> rows;
  for (const std::uint32_t length : lengths) {
    rows.push_back({length, 2 * length});  // white, then black of this length, in horizontal mode: the row above is empty
    rows.push_back({});
    rows.push_back({0, length});  // a white run of none
    rows.push_back({});
  }
  const Runs runs = testing::image_of(columns, rows);
  const std::string path = folder / "runs.tif";
  testing::save(path, testing::encoded(*find_image_format("tiff-g4"), runs));
  const auto image = formats::image(path);
  ASSERT_TRUE(image.ok()) << image.error().message;
  EXPECT_TRUE(same(*image, runs));
}

TEST(G4, EveryPairOfNeighbouringRowsOfNinePixelsComesBack) {
  const testing::Folder folder;
  constexpr std::uint32_t kColumns = 9;
  const auto row_of = [](std::uint32_t bits) {
    Row row;
    for (std::uint32_t column = 0; column <= kColumns; ++column) {
      const bool now = column < kColumns && (bits >> column & 1) != 0, before = column > 0 && (bits >> (column - 1) & 1) != 0;
      if (now != before) row.push_back(column);
    }
    return row;
  };
  std::vector<Row> rows;
  for (std::uint32_t above = 0; above < 512; ++above) {
    for (std::uint32_t below = 0; below < 512; ++below) {
      rows.push_back(row_of(above));
      rows.push_back(row_of(below));
    }
  }
  const Runs runs = testing::image_of(kColumns, rows);
  const std::string path = folder / "pairs.tif";
  testing::save(path, testing::encoded(*find_image_format("tiff-g4"), runs));
  const auto image = formats::image(path);
  ASSERT_TRUE(image.ok()) << image.error().message;
  EXPECT_TRUE(same(*image, runs));
}

/// The strip that libtiff's own encoder makes of the runs.
std::vector<std::byte> strip_by_libtiff(const std::string& path, const RunsView& runs) {
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  if (tiff == nullptr) return {};
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, runs.columns);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, runs.rows());
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 1);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_CCITTFAX4);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, runs.rows());
  for (std::uint32_t r = 0; r < runs.rows(); ++r) {
    std::vector<unsigned char> bits((runs.columns + 7) / 8);
    const auto row = runs.row(r);
    for (std::size_t i = 0; i < row.size(); i += 2) {
      for (std::uint32_t column = row[i]; column < row[i + 1]; ++column)
        bits[column / 8] |= static_cast<unsigned char>(0x80 >> (column % 8));
    }
    EXPECT_EQ(TIFFWriteScanline(tiff, bits.data(), r, 0), 1);
  }
  TIFFClose(tiff);
  tiff = TIFFOpen(path.c_str(), "r");
  if (tiff == nullptr) return {};
  std::vector<std::byte> strip(TIFFGetStrileByteCount(tiff, 0));
  EXPECT_EQ(TIFFReadRawStrip(tiff, 0, strip.data(), static_cast<tmsize_t>(strip.size())), static_cast<tmsize_t>(strip.size()));
  TIFFClose(tiff);
  return strip;
}

/// By every body that this processor has.
bool is_as_by_libtiff(const std::string& path, const Runs& runs) {
  const std::vector<std::byte> theirs = strip_by_libtiff(path, runs);
  return std::ranges::all_of(std::array{Isa::kPlain, Isa::kAvx2, Isa::kAvx512}, [&](Isa isa) {
    Bytes ours;
    g4::Encoder encoder(isa);
    ours.resize(encoder.encode(runs, ours, 0));
    return std::ranges::equal(ours, theirs);
  });
}

TEST(G4, TheBytesAreThoseOfLibtiffsOwnEncoder) {
  const testing::Folder folder;
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const std::uint32_t columns = seed < 40 ? 1 + seed * 7 : seed * 100;
    EXPECT_TRUE(is_as_by_libtiff(folder / "peer.tif", testing::random_image(1000 + seed, columns, 30)))
        << columns << ", seed " << seed;
  }
}

/// Rows of one number of changes that wander by up to `step` columns a row, through each other's neighbourhood and both sides.
Runs wandering_edges(std::uint32_t seed, std::uint32_t columns, std::uint32_t changes, std::uint32_t step) {
  std::mt19937 random(seed);
  std::vector<Row> rows;
  Row row;
  for (std::uint32_t i = 0; i < changes; ++i) row.push_back((2 * i + 1) * columns / (2 * changes));
  for (int r = 0; r < 400; ++r) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::int64_t low = i == 0 ? 0 : row[i - 1] + 1, high = i + 1 == row.size() ? columns : row[i + 1] - 1;
      const std::int64_t moved = std::int64_t{row[i]} + testing::below(random, 2 * step + 1) - step;
      row[i] = static_cast<std::uint32_t>(std::clamp(moved, low, high));
    }
    rows.push_back(row);
    if (testing::below(random, 40) == 0) rows.push_back(testing::neighbour(random, columns, row));  // of more or fewer changes
  }
  return testing::image_of(columns, rows);
}

TEST(G4, RowsOfFewEdgesThatWanderAreAsByLibtiff) {
  const testing::Folder folder;
  for (const std::uint32_t changes : {2u, 4u, 6u, 8u, 10u, 16u, 24u, 34u, 48u, 50u, 66u}) {
    for (const std::uint32_t columns : {5 * changes, 16 * changes, 500u}) {
      for (const std::uint32_t step : {1u, 3u, 5u}) {
        const Runs runs = wandering_edges(columns + step, columns, changes, step);
        EXPECT_TRUE(is_as_by_libtiff(folder / "peer.tif", runs))
            << changes << " changes, " << columns << " columns, step " << step;
      }
    }
  }
}

/// Edges so far from those above that 16 bits do not hold it, by nearly a multiple of 2^16.
TEST(G4, EdgesThatJumpFarAreAsByLibtiff) {
  const testing::Folder folder;
  std::mt19937 random(16);
  std::vector<Row> rows;
  for (int r = 0; r < 12; ++r) {
    Row row;
    for (std::uint32_t i = 0; i < 10; ++i) {
      const std::uint32_t jump = testing::below(random, 3) == 0 ? 65'536 * (1 + testing::below(random, 2)) : 0;
      row.push_back(1000 + 150'000 * i + jump + testing::below(random, 3));
    }
    rows.push_back(row);
  }
  EXPECT_TRUE(is_as_by_libtiff(folder / "peer.tif", testing::image_of(1'600'000, rows)));
}

TEST(G4, ManyEmptyRowsAreOneBitEach) {
  for (const std::uint32_t empty : {0u, 1u, 2u, 3u, 7u, 8u, 9u, 127u, 128u, 129u, 1000u, 18898u}) {
    std::vector<Row> rows(empty);
    Bytes file;
    g4::Encoder encoder;
    const std::size_t bits = std::size_t{empty} + 24;  // and EOFB
    EXPECT_EQ(encoder.encode(testing::image_of(18898, rows), file, 5), 5 + (bits + 7) / 8) << empty;
  }
}

}  // namespace
}  // namespace lamina::formats
