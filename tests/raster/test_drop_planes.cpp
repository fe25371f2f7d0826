// Images of materials and drops put together, against counts pixel by pixel.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stages/raster/images.h"
#include "tests/program/machines.h"

namespace lamina::raster {
namespace {

constexpr std::uint32_t kColumns = 31, kRows = 9;
using Counts = std::vector<std::uint32_t>;  // drops of each pixel

/// The pixels with at least so many drops.
Runs plane_of_counts(const Counts& counts, std::uint32_t minimum) {
  Runs plane;
  plane.columns = kColumns;
  plane.row_offset.assign(1, 0);
  for (std::uint32_t r = 0; r < kRows; ++r) {
    bool set = false;
    for (std::uint32_t c = 0; c <= kColumns; ++c) {
      const bool now = c < kColumns && counts[r * kColumns + c] >= minimum;
      if (now != set) plane.change.push_back(c);
      set = now;
    }
    plane.row_offset.push_back(static_cast<std::uint32_t>(plane.change.size()));
  }
  return plane;
}

/// Adds all images of the materials. returns  the first contradiction
std::string added_images(const std::vector<Counts>& materials, std::uint32_t images, DropPlanes& planes) {
  for (const Counts& counts : materials) {
    for (std::uint32_t k = 0; k < images; ++k) {
      if (const Status added = planes.add(plane_of_counts(counts, k + 1), k); !added) return added.error().message;
    }
  }
  return {};
}

Counts sum_of_counts(const std::vector<Counts>& materials) {
  Counts sum(kColumns * kRows, 0);
  for (const Counts& counts : materials) std::ranges::transform(sum, counts, sum.begin(), std::plus());
  return sum;
}

TEST(DropPlanes, AreThoseOfAllMaterialsTogether) {
  for (std::uint32_t seed = 1; seed <= 30; ++seed) {
    program::testing::Random random(seed);
    constexpr std::uint32_t kMax = 5;
    for (const bool shared : {false, true}) {
      std::vector<Counts> materials(3, Counts(kColumns * kRows, 0));
      for (std::uint32_t p = 0; p < kColumns * kRows; ++p) {
        std::uint32_t left = random() % (kMax + 1);
        if (!shared) materials[random() % 3][p] = left;
        for (std::size_t m = 0; shared && m < 3; ++m) {
          materials[m][p] = random() % (left + 1);
          left -= materials[m][p];
        }
      }
      DropPlanes planes(kMax, shared);
      ASSERT_EQ(added_images(materials, kMax, planes), "");
      ASSERT_EQ(planes.planes.size(), kMax);
      const Counts sum = sum_of_counts(materials);
      for (std::uint32_t k = 0; k < kMax; ++k) {
        const Runs right = plane_of_counts(sum, k + 1);
        EXPECT_EQ(planes.planes[k].row_offset, right.row_offset) << seed << shared;
        EXPECT_EQ(planes.planes[k].change, right.change) << seed << shared;
      }
    }
  }
}

TEST(DropPlanes, FindWhatContradicts) {
  const Counts none(kColumns * kRows, 0);
  Counts here = none, neighbour = none;
  here[40] = 2, neighbour[41] = 2;
  DropPlanes apart(2, false);
  EXPECT_EQ(added_images({here, neighbour}, 2, apart), "");
  DropPlanes met(2, false);
  EXPECT_EQ(added_images({here, here}, 2, met), "another material's image sets as well");
  DropPlanes few(2, true);
  EXPECT_EQ(added_images({here, here}, 2, few), "get more than 2 drops");
  DropPlanes enough(4, true);
  EXPECT_EQ(added_images({here, here}, 2, enough), "");
  for (const bool shared : {false, true}) {
    DropPlanes torn(2, shared);  // the second drop of one material where only the other has a first
    EXPECT_TRUE(torn.add(plane_of_counts(here, 1), 0).ok());
    EXPECT_TRUE(torn.add(plane_of_counts(here, 2), 1).ok());
    EXPECT_TRUE(torn.add(plane_of_counts(neighbour, 1), 0).ok());
    EXPECT_EQ(torn.add(plane_of_counts(here, 2), 1).error().message, "get no drop before");
  }
}

}  // namespace
}  // namespace lamina::raster
