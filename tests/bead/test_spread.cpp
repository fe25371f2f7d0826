// A bead spreads along its line: volume, evenness, round ends, and that cells come while the line is laid.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/bead/section.h"
#include "tests/bead/anet.h"

namespace lamina::bead {
namespace {

using namespace test;

TEST(BeadSpread, VolumeIsConservedAndCellsFollowEachOther) {
  for (const double cell : {0.007, 0.02, 0.1}) {
    BeadSpread spread(kHeight, cell);
    BeadLine line({0.1, 0.05, 400}, kHeight);
    for (int repeat = 0; repeat < 2; ++repeat) {  // a second line begins as the first did
      double volume = 0, place = 0;
      std::size_t cells = 0;
      const TakeCell take_cell = [&](const SpreadCell& c) {
        EXPECT_TRUE(cells++ == 0 || std::abs(c.begin_mm - place) < 1e-9);
        place = c.end_mm;
        volume += c.volume_mm3;
      };
      const TakePiece take = [&](const BeadPiece& p) { spread.add(p, take_cell); };
      line.begin({15, 0.2});
      for (int i = 0; i < 9; ++i) line.add({1.37, i % 2 == 0 ? 0.12 : 0.03, i % 3 == 0 ? 45.0 : 10.0}, take);
      EXPECT_GT(cells, 0U);  // before the line ends
      line.end(15, take);
      spread.end(take_cell);
      EXPECT_NEAR(volume / line.laid_mm3(), 1, 1e-12);
    }
  }
}

TEST(BeadSpread, AnEvenBeadStaysEvenAndEndsRound) {
  const auto widths = lay({0.1, 0, kAtOnce}, {{5, 0.1, 15}}, {15, 1.5}, 15, true);
  const double width = width_of(0.1, true, kHeight);
  EXPECT_NEAR(widths.front().place, -width / 2, 0.03);
  EXPECT_NEAR(widths.back().place, 5 + width / 2, 0.03);
  for (const Width& w : widths) {
    if (w.place < width || w.place > 5 - width) continue;
    EXPECT_NEAR(w.width, width, 2e-3);  // discs are counted in cells
  }
}

TEST(BeadSpread, ThickReachesIntoThinByHalfOfItsWidth) {
  const auto widths = lay({0.1, 0, kAtOnce}, {{5, 0.15, 15}, {5, 0.02, 15}}, {15, 1.5}, 15, true);
  const double thick = width_of(0.15, true, kHeight), thin = width_of(0.02, false, kHeight);
  EXPECT_GT(width_at(widths, 5 + 0.3 * thick), thin + 0.01);
  EXPECT_NEAR(width_at(widths, 5 + 0.5 * thick + 0.05), thin, 2e-3);
  EXPECT_NEAR(width_at(widths, 5 - 0.5 * thick - 0.05), thick, 2e-3);
}

TEST(BeadSpread, WhatIsWiderThanTheReachSpreadsSoFar) {
  BeadSpread spread(kHeight, 0.02, 0.5);
  double volume = 0, first = 1;
  const TakeCell take = [&](const SpreadCell& c) {
    first = std::min(first, c.begin_mm);
    volume += c.volume_mm3;
  };
  spread.add({0, 1, 3, 3, 10, 10, 3, true}, take);
  spread.end(take);
  EXPECT_NEAR(volume, 3, 1e-12);
  EXPECT_NEAR(first, -0.5, 0.03);
}

}  // namespace
}  // namespace lamina::bead
