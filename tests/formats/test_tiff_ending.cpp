// Files of an encoder that keeps the ending of the last one, against those that libtiff writes alone.
#include <gtest/gtest.h>

#include <random>

#include "stages/formats/image_format.h"
#include "tests/formats/images.h"

namespace lamina::formats {
namespace {

/// Rows of changes that far apart in the middle.
Runs noise(std::uint32_t columns, std::uint32_t rows, std::uint32_t spacing, std::mt19937& random) {
  std::vector<testing::Row> lines;
  for (std::uint32_t r = 0; r < rows; ++r) lines.push_back(testing::random_row(random, columns, spacing));
  return testing::image_of(columns, lines);
}

TEST(TiffEnding, FilesOfOneEncoderAreThoseOfNewOnes) {
  const ImageFormat& g4 = *find_image_format("tiff-g4");
  const auto kept = g4.make_encoder();
  std::mt19937 random(7);
  Bytes file, alone;
  std::size_t large = 0;
  for (std::uint32_t n = 0; n < 120; ++n) {
    const std::uint32_t side = n % 40 == 39 ? 601 : 600, spacing = n % 5 == 4 ? 3 : 100 + 200 * (n % 7);
    const double dpi = n % 30 == 29 ? 1200 : 600;
    const Runs image = noise(side * 4, side, spacing, random);
    if (n == 60) kept->tag({"order 7", "", "", 3, 9, 0, 1000});
    if (n == 61) kept->tag({});
    const auto fresh = g4.make_encoder();
    if (n == 60) fresh->tag({"order 7", "", "", 3, 9, 0, 1000});
    ASSERT_TRUE(kept->encode(image.view(), dpi, 600, file).ok());
    ASSERT_TRUE(fresh->encode(image.view(), dpi, 600, alone).ok());
    ASSERT_TRUE(std::equal(file.begin(), file.end(), alone.begin(), alone.end())) << n;
    large += file.size() > 65'536 ? 1 : 0;
  }
  EXPECT_GT(large, 10u) << "strips of both kinds of lengths";
}

}  // namespace
}  // namespace lamina::formats
