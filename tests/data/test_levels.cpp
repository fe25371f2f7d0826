// Levels as runs: what is appended, summed and cut into planes.
#include <gtest/gtest.h>

#include "stages/data/levels.h"

namespace lamina {
namespace {

TEST(Levels, TouchingRunsOfOneLevelAreOneRunAndOfAnotherLevelTwo) {
  Levels image;
  image.start(10);
  image.append(0, 2, 1);
  image.append(2, 4, 1);
  image.append(4, 5, 3);
  image.append(6, 6, 2);  // empty
  image.append(7, 9, 0);  // nothing
  image.end_row();
  image.append(0, 1, 3);  // a new row joins nothing of the row before
  image.end_row();
  EXPECT_EQ(image.view().rows(), 2u);
  EXPECT_EQ(image.level, (Buffer<std::uint8_t>{1, 3, 3}));
  EXPECT_EQ(image.change, (Buffer<std::uint32_t>{0, 4, 4, 5, 0, 1}));
  EXPECT_EQ(sum_of_levels(image), 4u + 3 + 3);
}

TEST(Levels, PlanesOfAllDropsHoldAsManyPixelsAsTheLevelsSumTo) {
  Levels image;
  image.start(20);
  for (std::uint32_t row = 0; row < 5; ++row) {
    for (std::uint32_t at = row; at + 3 <= 20; at += 3) image.append(at, at + 3, static_cast<std::uint8_t>((at * 7 + row) % 4));
    image.end_row();
  }
  std::uint64_t pixels = 0;
  Runs plane;
  for (std::uint8_t drop = 1; drop <= 3; ++drop) {
    threshold_levels(image, drop, plane);
    ASSERT_EQ(plane.view().rows(), 5u);
    for (std::uint32_t r = 0; r < 5; ++r) {
      const auto row = plane.view().row(r);
      for (std::size_t i = 1; i < row.size(); ++i) ASSERT_LT(row[i - 1], row[i]);  // runs neither touch nor overlap
    }
    pixels += set_pixels(plane);
  }
  EXPECT_EQ(pixels, sum_of_levels(image));
  Levels again;
  threshold_levels(image, 1, plane);
  levels_of(plane, 2, again);
  EXPECT_EQ(sum_of_levels(again), 2 * set_pixels(plane));
}

}  // namespace
}  // namespace lamina
