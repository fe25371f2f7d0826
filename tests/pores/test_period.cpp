// tests/pores/test_period.cpp: after how far images repeat.
#include <gtest/gtest.h>

#include <algorithm>

#include "stages/pores/registration.h"

namespace lamina {
namespace {

/// Bricks of 30 x 7 pixels, every other row of them shifted, on a ground of 40 x 20.
Runs bricks(std::uint32_t columns, std::uint32_t rows, std::uint32_t from) {
  Runs image;
  image.columns = columns;
  image.row_offset.assign(1, 0);
  for (std::uint32_t y = 0; y < rows; ++y) {
    for (std::uint32_t x = y % 20 < 10 ? from : from + 20; y % 10 < 7 && x < columns; x += 40) {
      image.change.push_back(x);
      image.change.push_back(std::min(x + 30, columns));
    }
    image.row_offset.push_back(static_cast<std::uint32_t>(image.change.size()));
  }
  return image;
}

TEST(Period, OfBricksIsThatOfTheirRowsAndColumns) {
  const Runs image = bricks(390, 200, 5);
  EXPECT_EQ(pores::period(image, true, 10, 0.05), 40u);
  EXPECT_EQ(pores::period(image, false, 5, 0.05), 20u) << "every other row is shifted";
  EXPECT_EQ(pores::period(image, true, 45, 0.05), 80u);
  EXPECT_EQ(pores::period(bricks(100, 40, 5), true, 10, 0.001), 0u) << "three periods have to be there";
}

TEST(Period, OfEmptyAndFullImagesIsNone) {
  Runs image;
  image.columns = 60;
  image.row_offset.assign(31, 0);
  EXPECT_EQ(pores::period(image, true, 1, 0.1), 0u);
}

TEST(Period, ImagesDifferByTheirShareOfPixels) {
  const Runs one = bricks(390, 200, 5), other = bricks(390, 200, 8);
  EXPECT_EQ(pores::mismatch(one, one), 0);
  EXPECT_NEAR(pores::mismatch(one, other), 0.1, 0.01) << "3 of 30 pixels at both ends";
}

}  // namespace
}  // namespace lamina
