// A pattern in its steady state: the widths told are those of a long line.
#include <gtest/gtest.h>

#include "stages/bead/predicted_tables.h"
#include "tests/bead/anet.h"
#include "tests/bead/pore.h"

namespace lamina::bead {
namespace {

using namespace test;

TEST(Pattern, WidthsAreThoseOfALongLine) {
  for (const double acceleration : {kAtOnce, kProfile}) {
    const BeadMachine machine{0.1, 0.05, acceleration};
    for (const bool spread : {false, true}) {
      for (const double extrusion : {60.0, 75.0, 125.0}) {
        const auto line = deposit_repeated(machine, extrusion, 11.25, spread);
        const PatternWidths widths = steady_widths(machine, kHeight, {1.5, 1.5, extrusion, 11.25, 30}, spread);
        EXPECT_NEAR(widths.thick.middle, width_at(line, 9.75), 1e-3);
        EXPECT_NEAR(widths.thin.middle, width_at(line, 11.25), 1e-3);
        EXPECT_NEAR(widths.thick.mean, mean_width(line, 9, 10.5), 1e-3);
        EXPECT_NEAR(widths.thin.mean, mean_width(line, 10.5, 12), 1e-3);
        EXPECT_LE(widths.thin.minimum, widths.thin.mean);
        EXPECT_GE(widths.thick.largest, widths.thick.mean);
        EXPECT_NEAR(widths.sums.fed_mm3, 3 * 0.1 * extrusion / 100, 1e-12);
      }
    }
  }
}

TEST(Pattern, TimeAndSpeedAreThoseOfTheHead) {
  const PatternWidths at_once = steady_widths({0.1, 0.05, kAtOnce}, kHeight, {1.5, 1.5, 100, 15, 30}, false);
  EXPECT_NEAR(at_once.sums.seconds, 1.5 / 15 + 1.5 / 30, 1e-12);
  EXPECT_EQ(at_once.sums.peak_mm_s, 30);
  // 1.5 mm between 7.5 and 30 mm/s at 500 mm/s2.
  const PatternWidths profile = steady_widths({0.1, 0.05, kProfile}, kHeight, {1.5, 1.5, 100, 7.5, 30}, false);
  EXPECT_NEAR(profile.sums.peak_mm_s, std::sqrt(7.5 * 7.5 + 500 * 1.5), 1e-12);
  EXPECT_NEAR(profile.sums.seconds, 1.5 / 7.5 + 2 * (profile.sums.peak_mm_s - 7.5) / 500, 1e-12);
}

TEST(Pattern, OneOfOneSpeedIsEven) {
  const PatternWidths widths = steady_widths({0.1, 0.05, kProfile}, kHeight, {0.5, 0.1, 120, 20, 20}, false);
  const double width = width_of(0.12, true, kHeight);
  for (const IntervalWidths& w : {widths.thick, widths.thin}) {
    for (const double value : {w.middle, w.mean, w.minimum, w.largest}) EXPECT_NEAR(value, width, 1e-12);
  }
}

TEST(Pore, ItsWidthAndLengthsAreThoseOfTheGapAlongALine) {
  for (const bool spread : {false, true}) {
    const BeadMachine machine{0.1, 0.05, kProfile};
    const auto line = deposit_repeated(machine, 100, 11.25, spread);
    const BeadPore pore = adjacent_pore(machine, kHeight, {1.5, 1.5, 100, 11.25, 30}, 0.43, 0.4, 0.02, spread);
    const auto gap = [&](double position) { return 0.43 - (width_at(line, position) + 0.4) / 2; };
    EXPECT_NEAR(pore.width, gap(11.25), 1e-3);
    EXPECT_GE(pore.widest, pore.width);
    for (const auto& [length, level] : {std::pair{pore.half_length, pore.width / 2}, {pore.open_length, 0.02}}) {
      double begin = 11.25, end = 11.25;
      while (gap(begin) >= level) begin -= 0.001;
      while (gap(end) >= level) end += 0.001;
      EXPECT_NEAR(length, end - begin, 0.01) << spread << ' ' << level;
    }
  }
}

TEST(Pore, BeadsThatNeverTouchLeaveASlotAndBeadsTooNearNone) {
  const BeadMachine machine{0.1, 0.05, kProfile};
  const Pattern pattern{1.5, 1.5, 100, 15, 15};  // an even bead
  const double width = width_of(0.1, true, kHeight);
  const BeadPore slot = adjacent_pore(machine, kHeight, pattern, 0.5, 0.4, 0.02, false);
  EXPECT_NEAR(slot.width, 0.5 - (width + 0.4) / 2, 1e-12);
  EXPECT_NEAR(slot.open_length, 3, 1e-12);
  EXPECT_NEAR(slot.half_length, 3, 1e-12);
  const BeadPore none = adjacent_pore(machine, kHeight, pattern, 0.35, 0.4, 0.02, false);
  EXPECT_LT(none.width, 0);
  EXPECT_EQ(none.open_length, 0);
}

}  // namespace
}  // namespace lamina::bead
