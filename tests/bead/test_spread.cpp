// A bead spreads along its line: volume, evenness, the shape of its end, and that cells come during its deposition.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "stages/bead/line.h"
#include "tests/bead/anet.h"

namespace lamina::bead {
namespace {

using namespace test;

TEST(BeadSpread, VolumeIsConservedAndCellsFollowEachOther) {
  for (const double cell : {0.007, 0.02, 0.1}) {
    BeadSpread spread(kHeight, cell);
    BeadLine line({0.1, 0.05, 400}, kHeight);
    for (int repeat = 0; repeat < 2; ++repeat) {  // a second line begins as the first did
      double volume = 0, position = 0;
      std::size_t cells = 0;
      const TakeCell take_cell = [&](const SpreadCell& c) {
        EXPECT_TRUE(cells++ == 0 || std::abs(c.begin_mm - position) < 1e-9);
        position = c.end_mm;
        volume += c.volume_mm3;
      };
      const TakePiece take = [&](const BeadPiece& p) { spread.add(p, take_cell); };
      line.begin({15, 0.2});
      for (int i = 0; i < 9; ++i) line.add({1.37, i % 2 == 0 ? 0.12 : 0.03, i % 3 == 0 ? 45.0 : 10.0}, take);
      EXPECT_GT(cells, 0U);  // before the line ends
      line.end(15, take);
      spread.end(take_cell);
      EXPECT_NEAR(volume / line.deposited_mm3(), 1, 1e-12);
    }
  }
}

/// Of its cross-section, the share that a line whose nozzle stops at 5 mm has at a place.
std::vector<SpreadCell> stopped(double width, double area, double cell) {
  BeadSpread spread(kHeight, cell);
  std::vector<SpreadCell> cells;
  const TakeCell take = [&](const SpreadCell& c) { cells.push_back(c); };
  spread.add({0, 5, area, area, width, width, 5 * area, true}, take);
  spread.end(take);
  return cells;
}

TEST(BeadSpread, AnEvenBeadStaysEven) {
  const double area = 0.1, width = width_of(area, true, kHeight);
  for (const SpreadCell& c : stopped(width, area, 0.002)) {
    if (c.begin_mm < 0.25 * width || c.end_mm > 5 - width) continue;
    EXPECT_NEAR(c.area_mm2, area, 1e-4 * area);
    EXPECT_NEAR(c.width_mm, width, 1e-4);
  }
}

/// The melt's edge around a nozzle that moves evenly: x = w / pi ln(2 cos(pi y / w)), the finger of Saffman and Taylor, 1958.
TEST(BeadSpread, ALineEndsAsTheFingerThatTheNozzlePushes) {
  constexpr double kPi = std::numbers::pi;
  const double area = 0.12, width = width_of(area, true, kHeight);
  const double kept = 2 / kPi * std::acos(std::exp(-kPi) / 2);  // within a width behind the nozzle
  std::size_t detected = 0;
  for (const SpreadCell& c : stopped(width, area, 0.002)) {
    const double position = (c.begin_mm + c.end_mm) / 2 - 5, side = kept * c.area_mm2 / area * width / 2;
    EXPECT_LT(position, width * std::numbers::ln2 / kPi + 0.002);
    if (position < -0.9 * width || side < 0.05 * width) continue;
    EXPECT_NEAR(position, width / kPi * std::log(2 * std::cos(kPi * side / width)), 0.002);
    if (std::abs(position) < 0.0011) {
      EXPECT_NEAR(side, width / 3, 0.001) << "two thirds of the bead under the nozzle";
    }
    ++detected;
  }
  EXPECT_GT(detected, 200U);
}

TEST(BeadSpread, ThickReachesIntoThinAheadAndBehind) {
  const double thick = width_of(0.15, true, kHeight), thin = width_of(0.02, false, kHeight);
  const auto into = deposit({0.1, 0, kAtOnce}, {{5, 0.15, 15}, {5, 0.02, 15}}, {15, 2.25}, 15, true);
  EXPECT_GT(width_at(into, 5 + 0.15 * thick), thin + 0.01);
  EXPECT_NEAR(width_at(into, 5 + 0.25 * thick + 0.03), thin, 2e-3);
  const auto out = deposit({0.1, 0, kAtOnce}, {{5, 0.02, 15}, {5, 0.15, 15}}, {15, 0.3}, 15, true);
  EXPECT_GT(width_at(out, 5 - 0.3 * thick), thin + 0.01);
  EXPECT_NEAR(width_at(out, 5 - thick - 0.03), thin, 2e-3);
}

TEST(BeadSpread, WhatIsWiderThanTheReachSpreadsAsThat) {
  BeadSpread spread(kHeight, 0.02, 0.5);
  double volume = 0, first = 1;
  const TakeCell take = [&](const SpreadCell& c) {
    first = std::min(first, c.begin_mm);
    volume += c.volume_mm3;
  };
  spread.add({0, 1, 3, 3, 10, 10, 3, true}, take);
  spread.end(take);
  EXPECT_NEAR(volume, 3, 1e-12);
  EXPECT_NEAR(first, -1, 0.03);
}

}  // namespace
}  // namespace lamina::bead
