// Beads that leave each other no room: nothing is lost, and what has room is left alone.
#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <random>
#include <vector>

#include "stages/bead/line.h"
#include "tests/bead/neighbours.h"

namespace lamina::bead {
namespace {

constexpr double kLayerHeight = 0.3;                                             // mm, of the layer
const double kCusps = kLayerHeight * kLayerHeight * (1 - std::numbers::pi / 4);  // of two stadia that touch

AdjacentBead stadium(double centre, double width) { return {centre, bead_area(width, kLayerHeight), width}; }

/// The material of what was squeezed: the space between the outer centres and, outside of them, halves of the beads alone.
double material(const std::vector<AdjacentBead>& beads, const Buffer<SqueezedBead>& out, double period) {
  double sum = 0;
  for (std::size_t i = 0; i < beads.size(); ++i) {
    const bool from_left = i > 0 ? out[i - 1].touches_right : out.back().touches_right && period > 0;
    for (const bool right : {false, true}) {
      const double reach = right ? out[i].right_mm - beads[i].centre_mm : beads[i].centre_mm - out[i].left_mm;
      const double alone = beads[i].area_mm2 / 2 + kLayerHeight * (reach - beads[i].width_mm / 2);
      sum += (right ? out[i].touches_right : from_left) ? out[i].height_mm * reach : alone;
    }
    sum -= out[i].cusps_mm2;
  }
  return sum;
}

TEST(Squeeze, NothingIsLostAndNoTwoOverlap) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> width(0.05, 0.9), distance(0.15, 0.7);
  Buffer<SqueezedBead> out;
  for (int trial = 0; trial < 2000; ++trial) {
    std::vector<AdjacentBead> beads;
    double position = 0, sum = 0;
    for (int i = 0; i <= trial % 9; ++i) {
      beads.push_back(stadium(position, width(random)));
      position += distance(random);
      sum += beads.back().area_mm2;
    }
    const double period = trial % 2 == 0 ? 0 : position;
    squeeze(beads, kLayerHeight, period, out);
    EXPECT_NEAR(material(beads, out, period) / sum, 1, 1e-12);
    for (std::size_t i = 0; i < beads.size(); ++i) {
      if (i + 1 == beads.size() && period == 0) continue;
      const double next = i + 1 < beads.size() ? out[i + 1].left_mm : out[0].left_mm + period;
      EXPECT_LE(out[i].right_mm, next + 1e-12);
      EXPECT_EQ(out[i].touches_right, out[i].right_mm > next - 1e-12);
      EXPECT_GE(out[i].cusps_mm2, 0);
    }
  }
}

TEST(Squeeze, BeadsWithSpaceAreLeftAlone) {
  const std::vector<AdjacentBead> beads{stadium(0, 0.4), stadium(0.43, 0.4), stadium(1, 0.2)};
  Buffer<SqueezedBead> out;
  squeeze(beads, kLayerHeight, 0, out);
  for (std::size_t i = 0; i < beads.size(); ++i) {
    EXPECT_NEAR(out[i].width(), beads[i].width_mm, 1e-15);
    EXPECT_FALSE(out[i].touches_right);
  }
}

TEST(Squeeze, TwoStadiaFillTheirCuspsAndThenWiden) {
  Buffer<SqueezedBead> out;
  const double holds = kCusps / kLayerHeight;  // mm of overlap
  EXPECT_NEAR(holds, 0.0644, 1e-4);
  for (const double overlap : {0.0, 0.03, 0.06, 0.1}) {
    const std::vector<AdjacentBead> beads{stadium(0, 0.4), stadium(0.4 - overlap, 0.4)};
    squeeze(beads, kLayerHeight, 0, out);
    ASSERT_TRUE(out[0].touches_right);
    EXPECT_NEAR(out[0].cusps_mm2, std::max(kCusps - kLayerHeight * overlap, 0.0), 1e-12);
    EXPECT_NEAR(out[0].left_mm, -0.2 - std::max(overlap - holds, 0.0) / 2, 1e-12);
    EXPECT_NEAR(out[1].right_mm, 0.6 - overlap + std::max(overlap - holds, 0.0) / 2, 1e-12);
    EXPECT_NEAR(out[0].right_mm, 0.2 - overlap / 2, 1e-12);
  }
}

TEST(Squeeze, AnEndlessRasterThatIsOverfilledIsAboveTheLayer) {
  Buffer<SqueezedBead> out;
  const std::vector<AdjacentBead> beads{stadium(0, 0.5), stadium(0.3, 0.4)};
  squeeze(beads, kLayerHeight, 0.6, out);
  EXPECT_NEAR(out[0].height_mm * 0.6, beads[0].area_mm2 + beads[1].area_mm2, 1e-12);
  EXPECT_NEAR(out[0].width() + out[1].width(), 0.6, 1e-12);
  const std::vector<AdjacentBead> one{stadium(0, 0.4)};
  squeeze(one, kLayerHeight, 0.38, out);
  EXPECT_NEAR(out[0].cusps_mm2, kCusps - kLayerHeight * 0.02, 1e-12);
  EXPECT_EQ(out[0].height_mm, kLayerHeight);
}

TEST(Squeeze, WhatIsPushedOutwardsReachesTheNextBead) {
  Buffer<SqueezedBead> out;
  const std::vector<AdjacentBead> beads{stadium(0, 0.6), stadium(0.3, 0.6), stadium(0.81, 0.4)};
  squeeze(beads, kLayerHeight, 0, out);  // the second alone ends at 0.6, the third begins at 0.61
  EXPECT_TRUE(out[1].touches_right);
}

}  // namespace
}  // namespace lamina::bead
