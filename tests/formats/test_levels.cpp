// Formats that carry levels: round trips, bytes that do not change, values that no level has.
#include <gtest/gtest.h>
#include <tiffio.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "stages/data/levels.h"
#include "stages/formats/image_format.h"
#include "stages/formats/images/image.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

constexpr std::uint8_t kFullLevels[] = {1, 3, 15};

Levels random_levels(std::uint32_t seed, std::uint32_t columns, std::uint32_t rows, std::uint8_t full, std::uint32_t longest) {
  std::mt19937 random(seed);
  Levels levels;
  levels.start(columns);
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t c = 0; c < columns && r % 5 != 3;) {
      const std::uint32_t end = std::min<std::uint32_t>(columns, c + 1 + static_cast<std::uint32_t>(random() % longest));
      levels.append(c, end, static_cast<std::uint8_t>(random() % (full + 1u)));
      c = end;
    }
    levels.end_row();
  }
  return levels;
}

class LevelFiles : public ::testing::TestWithParam<const char*> {
 protected:
  std::string path() const {
    return ::testing::TempDir() + "lamina_levels_" + std::to_string(::getpid()) + std::string(format().extension);
  }
  const LevelFormat& format() const { return *find_level_format(GetParam()); }
  void TearDown() override { ::unlink(path().c_str()); }
};

TEST_P(LevelFiles, GiveTheLevelsBack) {
  const auto encoder = format().make_encoder();
  Bytes file;
  std::uint32_t seed = 1;
  for (const std::uint32_t columns : {1u, 2u, 7u, 64u, 259u, 4000u}) {
    for (const std::uint8_t full : kFullLevels) {
      ++seed;
      const Levels image = random_levels(seed, columns, 40, full, seed % 2 == 0 ? 3 : 700);
      ASSERT_TRUE(encoder->encode(image, full, 600, 300, file).ok());
      EXPECT_LE(file.size(), format().max_bytes(columns, 40, image.change.size()));
      testing::save(path(), file);
      Levels back;
      const auto read = formats::levels(path(), full, back);
      ASSERT_TRUE(read.ok()) << read.error().message;
      EXPECT_NEAR(read->dpi_x, 600, 0.01);
      EXPECT_NEAR(read->dpi_y, 300, 0.01);
      EXPECT_TRUE(back.change == image.change && back.level == image.level && back.row_offset == image.row_offset);
      Runs any;
      threshold_levels(image, 1, any);
      EXPECT_TRUE(read->runs.change == any.change);
    }
  }
}

// What lamina's own reader of images of others makes of them by the threshold of 128: voxels half full or more.
TEST_P(LevelFiles, AreHalvesToAReaderThatTakesTheDarkPixels) {
  if (format().id == "tiff-4") return;  // formats::dark_pixels takes 1, 8 and 16 bits
  const auto encoder = format().make_encoder();
  Bytes file;
  for (const std::uint8_t full : kFullLevels) {
    const Levels image = random_levels(full, 90, 20, full, 4);
    ASSERT_TRUE(encoder->encode(image, full, 600, 600, file).ok());
    testing::save(path(), file);
    const auto read = formats::dark_pixels(path(), 128);
    ASSERT_TRUE(read.ok()) << read.error().message;
    Runs half;
    threshold_levels(image, static_cast<std::uint8_t>((full + 1) / 2), half);
    EXPECT_TRUE(read->runs.change == half.change);
  }
}

TEST_P(LevelFiles, RefuseOtherLevelsAndTiffsOfOneBit) {
  const auto encoder = format().make_encoder();
  Bytes file;
  const Levels image = random_levels(5, 30, 9, 15, 3);
  EXPECT_FALSE(encoder->encode(image, 16, 600, 600, file).ok());
  EXPECT_FALSE(encoder->encode(Levels(), 15, 600, 600, file).ok());
  ASSERT_TRUE(encoder->encode(image, 15, 600, 600, file).ok());
  testing::save(path(), file);
  Levels back;
  const auto read = formats::levels(path(), 3, back);
  ASSERT_FALSE(read.ok());
  EXPECT_NE(read.error().message.find("a value is no level"), std::string::npos) << read.error().message;
  EXPECT_FALSE(formats::image(path()).ok());
  for (std::size_t cut : {file.size() / 2, file.size() - 3}) {
    Bytes part = file;
    part.resize(cut);
    testing::save(path(), part);
    EXPECT_FALSE(formats::levels(path(), 15, back).ok());
  }
  testing::save(path(), testing::encoded(*find_image_format(format().extension == ".png" ? "png" : "tiff-none"),
                                         testing::image_of(9, {{1, 5}, {}})));
  const bool packed = format().extension == ".png";  // as optipng and pngquant write layers of white and black
  EXPECT_EQ(formats::levels(path(), 15, back).ok(), packed);
  if (packed) {
    EXPECT_EQ(sum_of_levels(back), 4 * 15u);
  }
}

// As in test_metadata.cpp: LAMINA_WRITE_GOLDEN writes them again.
TEST_P(LevelFiles, AreTheBytesThatTheyAlwaysWere) {
  Levels image;
  image.start(11);
  image.append(0, 3, 15);
  image.append(3, 4, 8);
  image.append(10, 11, 1);
  image.end_row();
  image.end_row();
  image.append(1, 10, 7);
  image.end_row();
  Bytes file;
  ASSERT_TRUE(format().make_encoder()->encode(image, 15, 1200, 600, file).ok());
  const std::string golden =
      std::string(LAMINA_TEST_DIR) + "/golden/write/small." + std::string(format().id) + std::string(format().extension);
  if (std::getenv("LAMINA_WRITE_GOLDEN") != nullptr) testing::save(golden, file);
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(file.data()), file.size()), testing::load(golden));
}

/// Bytes of a row of 8 bits over all its pixels, packed by libtiff.
std::string packed_by_libtiff(const Levels& image, unsigned step, const std::string& path) {
  const std::uint32_t rows = image.view().rows();
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.columns);
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, rows);
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, 8);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, rows);
  TIFFSetField(tiff, TIFFTAG_COMPRESSION, COMPRESSION_PACKBITS);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISWHITE);
  std::vector<std::uint8_t> all(std::size_t{image.columns} * rows);
  for (std::uint32_t r = 0; r < rows; ++r) {
    for (std::uint32_t i = image.row_offset[r]; i < image.row_offset[r + 1]; ++i) {
      std::fill(all.begin() + r * image.columns + image.change[2 * i],
                all.begin() + r * image.columns + image.change[2 * i + 1], static_cast<std::uint8_t>(image.level[i] * step));
    }
  }
  EXPECT_GT(TIFFWriteEncodedStrip(tiff, 0, all.data(), static_cast<tmsize_t>(all.size())), 0);
  TIFFClose(tiff);
  return testing::load(path);
}

TEST(GreyTiffs, HaveTheStripsThatLibtiffMakesOfWholeRows) {
  const auto encoder = find_level_format("tiff-8")->make_encoder();
  const std::string path = ::testing::TempDir() + "lamina_packed_" + std::to_string(::getpid());
  Bytes file;
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    const std::uint32_t longest[] = {2, 3, 5, 130, 300};
    const Levels image = random_levels(seed, 1 + 97 * seed, 5, 15, longest[seed % 5]);
    ASSERT_TRUE(encoder->encode(image, 15, 600, 600, file).ok());
    const std::string other = packed_by_libtiff(image, 17, path);
    // Both put the only strip behind the header of 8 bytes, and the directory behind the strip.
    std::uint32_t end = 0;
    std::memcpy(&end, other.data() + 4, sizeof end);
    ASSERT_LE(end, file.size());
    EXPECT_EQ(std::string(reinterpret_cast<const char*>(file.data()) + 8, end - 8), other.substr(8, end - 8)) << seed;
  }
  ::unlink(path.c_str());
}

INSTANTIATE_TEST_SUITE_P(All, LevelFiles, ::testing::Values("tiff-4", "tiff-8", "png-8"));

}  // namespace
}  // namespace lamina::formats
