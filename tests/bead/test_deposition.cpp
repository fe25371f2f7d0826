// The beads of a layer as a file commands them: what is fed is deposited along the line.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/bead/deposition.h"
#include "stages/bead/predicted_tables.h"

namespace lamina::bead {
namespace {

constexpr double kDepositedHeight = 0.3, kDepositedArea = 0.102, kDepositedLag = 0.046;  // mm, mm2, s

DepositionRules deposition_rules(double acceleration, bool spread = false) {
  return {{0, kDepositedLag, acceleration}, 8, 1, kDepositedHeight, 0.02, 15, {}, spread};
}

/// A line through places, mm, of one cross-section or of one for each piece of the way.
struct CommandedWay {
  Buffer<DepositedBead> beads;
  Buffer<BeadFeed> feeds;

  void add(double x0, double y0, double x1, double y1, double speed, double area, bool joined) {
    const auto at = [](double x, double y) {
      return Point2{static_cast<Nm>(std::lround(x * 1e6)), static_cast<Nm>(std::lround(y * 1e6))};
    };
    beads.push_back({at(x0, y0), at(x1, y1), 400'000, 0});
    feeds.push_back({area * std::hypot(x1 - x0, y1 - y0), speed, joined});
  }
};

Buffer<DepositedPiece> pieces_of(const CommandedWay& way, const DepositionRules& rules) {
  Buffer<DepositedPiece> pieces;
  deposit(way.beads, way.feeds, rules, pieces);
  return pieces;
}

double length_of_piece(const DepositedPiece& piece) {
  return std::hypot(mm(piece.to.x - piece.from.x), mm(piece.to.y - piece.from.y));
}
double volume_of_pieces(const Buffer<DepositedPiece>& pieces) {
  double sum = 0;
  for (const DepositedPiece& piece : pieces) sum += piece.area_mm2 * length_of_piece(piece);
  return sum;
}

TEST(DepositedBeads, ACommandedAccelerationCountsBeforeThatOfTheMachine) {
  const auto widths = [](double machine, double commanded) {
    CommandedWay way;
    for (int i = 0; i < 8; ++i) way.add(1.5 * i, 0, 1.5 * (i + 1), 0, i % 2 == 0 ? 15 : 30, kDepositedArea, i > 0);
    for (BeadFeed& feed : way.feeds) feed.acceleration_mm_s2 = commanded;
    std::vector<double> all;
    for (const DepositedPiece& piece : pieces_of(way, deposition_rules(machine))) all.push_back(piece.width_mm);
    return all;
  };
  EXPECT_EQ(widths(400, 1000), widths(1000, 0));
  EXPECT_EQ(widths(1000, 400), widths(400, 0));
  EXPECT_NE(widths(400, 0), widths(1000, 0));
}

TEST(DepositedBeads, AnEvenLineIsWhatIsFedAndItsMelt) {
  CommandedWay way;
  way.add(1, 2, 21, 2, 15, kDepositedArea, false);
  const auto pieces = pieces_of(way, deposition_rules(INFINITY));
  // From the corner's speed on the head goes faster at once: what comes late is what the lag holds in addition.
  EXPECT_NEAR(volume_of_pieces(pieces), 20 * kDepositedArea - kDepositedLag * kDepositedArea * (15 - 8), 1e-4);
  for (const DepositedPiece& piece : pieces) {
    EXPECT_EQ(piece.from.y, 2'000'000);
    if (mm(piece.from.x) > 10 && mm(piece.to.x) < 20) {
      EXPECT_NEAR(piece.width_mm, bead_width(kDepositedArea, kDepositedHeight), 3e-4);
    }
  }
  EXPECT_EQ(pieces.front().from.x, 1'000'000);
  EXPECT_EQ(pieces.back().to.x, 21'000'000);
  const auto spread = pieces_of(way, deposition_rules(INFINITY, true));
  EXPECT_NEAR(volume_of_pieces(spread), volume_of_pieces(pieces), 1e-4);
  EXPECT_LT(spread.front().from.x, 1'000'000) << "round ends reach out";
  EXPECT_GT(spread.back().to.x, 21'000'000);
}

TEST(DepositedBeads, AWayRoundCornersKeepsItsVolumeAndSlowsDownThere) {
  CommandedWay way;
  way.add(0, 0, 10, 0, 30, kDepositedArea, false);
  way.add(10, 0, 10, 10, 30, kDepositedArea, true);
  way.add(10, 10, 20, 10, 30, kDepositedArea, true);
  way.add(20, 10, 30, 10, 8, kDepositedArea, true);
  const auto slow = pieces_of(way, deposition_rules(400)), free = pieces_of(way, deposition_rules(INFINITY));
  double widest_slow = 0, widest_free = 0;
  for (const DepositedPiece& p : slow)
    if (p.from.y > 1'000'000 && p.from.y < 9'999'000) widest_slow = std::max(widest_slow, p.width_mm);
  for (const DepositedPiece& p : free)
    if (p.from.y > 1'000'000 && p.from.y < 9'999'000) widest_free = std::max(widest_free, p.width_mm);
  EXPECT_GT(widest_slow, 1.05 * bead_width(kDepositedArea, kDepositedHeight))
      << "melt that was on its way comes while the head brakes";
  EXPECT_GT(widest_slow, 1.01 * widest_free);
  // It ends as it began, slowly: what is held is the same.
  EXPECT_NEAR(volume_of_pieces(slow), 40 * kDepositedArea, 1e-4);
  EXPECT_NEAR(volume_of_pieces(free), 40 * kDepositedArea, 1e-4);
}

TEST(DepositedBeads, APatternSettlesOnTheWidthsOfItsSteadyState) {
  CommandedWay way;
  for (int i = 0; i < 8; ++i) {
    way.add(0, 3 * i, 0, 3 * i + 1.5, 11.25, kDepositedArea, i > 0);
    way.add(0, 3 * i + 1.5, 0, 3 * i + 3, 30, kDepositedArea, true);
  }
  for (const bool spread : {false, true}) {
    const PatternWidths steady =
        steady_widths({kDepositedArea, kDepositedLag, 400}, kDepositedHeight, {1.5, 1.5, 100, 11.25, 30}, spread);
    double minimum = 1, maximum = 0;
    for (const DepositedPiece& piece : pieces_of(way, deposition_rules(400, spread))) {
      if (piece.from.y < 15'000'000 || piece.to.y > 18'000'000) continue;
      minimum = std::min(minimum, piece.width_mm);
      maximum = std::max(maximum, piece.width_mm);
    }
    EXPECT_NEAR(minimum, steady.thin.minimum, 2e-3);
    EXPECT_NEAR(maximum, steady.thick.largest, 5e-3);
  }
}

/// The melt keeps its content from the end of the previous line: all fed is deposited, except what the last line leaves.
TEST(DepositedBeads, ALineBeginsWithWhatTheLineBeforeLeftBehind) {
  CommandedWay one, both;
  one.add(0, 0, 15, 0, 30, kDepositedArea, false);
  both = one;
  both.add(15, 1, 0, 1, 15, kDepositedArea, false);
  const DepositionRules rules = deposition_rules(400);
  const auto first = pieces_of(one, rules), together = pieces_of(both, rules);
  for (std::size_t i = 0; i < first.size(); ++i) EXPECT_EQ(together[i].width_mm, first[i].width_mm);
  ASSERT_GT(together.size(), first.size());
  EXPECT_GT(together[first.size()].width_mm, 1.2 * bead_width(kDepositedArea, kDepositedHeight)) << "behind a faster line";
  // Both ends are braked to 8 mm/s from other speeds; the flow of 30 mm/s still runs at the first, 22 mm/s too much at most.
  EXPECT_NEAR(volume_of_pieces(together), 30 * kDepositedArea, kDepositedLag * kDepositedArea * 8);
}

/// Material fed in addition between two lines is deposited where the second begins; a purge is not.
TEST(DepositedBeads, WhatIsPrimedIsDepositedWhereALineBegins) {
  const DepositionRules rules = deposition_rules(400);
  const auto volume_of_second = [&](double primed) {
    CommandedWay way;
    way.add(0, 0, 15, 0, 15, kDepositedArea, false);
    way.add(15, 1, 0, 1, 15, kDepositedArea, false);
    way.feeds[1].primed_mm3 = primed;
    double sum = 0;
    for (const DepositedPiece& piece : pieces_of(way, rules))
      if (piece.from.y > 0) sum += piece.area_mm2 * length_of_piece(piece);
    return sum;
  };
  const double as_it_is = volume_of_second(0);
  EXPECT_NEAR(volume_of_second(0.02), as_it_is + 0.02, 1e-4);
  EXPECT_NEAR(volume_of_second(-0.02), as_it_is - 0.02, 1e-4);
  EXPECT_LT(volume_of_second(5), as_it_is) << "begins as the first line of all does";
}

/// A box cuts away what does not reach into it, and changes nothing of what does.
TEST(DepositedBeads, ABoxLeavesOutWhatDoesNotReachIntoIt) {
  CommandedWay way;
  way.add(0, 0, 2000, 0, 15, kDepositedArea, false);
  DepositionRules rules = deposition_rules(400);
  rules.within.add(Point3{1'500'000'000, -1'000'000, 0});
  rules.within.add(Point3{1'504'000'000, 1'000'000, 0});
  const auto pieces = pieces_of(way, rules);
  ASSERT_GE(pieces.size(), 200u);
  EXPECT_LE(pieces.size(), 202u + 50u) << "a bead's width on both sides";
  EXPECT_LE(pieces.front().from.x, 1'500'000'000);
  EXPECT_GE(pieces.back().to.x, 1'504'000'000);
  EXPECT_NEAR(volume_of_pieces(pieces), static_cast<double>(pieces.size()) * 0.02 * kDepositedArea, 2e-5);
}

TEST(DepositedBeads, BeadsWithoutLengthSpeedOrFeedDoNoHarm) {
  CommandedWay way;
  way.add(0, 0, 1, 0, 0, kDepositedArea, false);
  way.add(1, 0, 1, 0, 15, kDepositedArea, true);
  way.add(1, 0, 2, 0, 1e-3, kDepositedArea, true);
  way.add(2, 0, 3, 0, 15, 0, true);
  way.add(3, 0, 3, 0, 15, 0, true);
  way.add(3, 0, 4, 0, 1e300, 1e300, true);
  way.add(4, 0, 5, 0, 1e-300, 1e300, true);
  for (const DepositedPiece& piece : pieces_of(way, deposition_rules(400, true))) {
    EXPECT_TRUE(std::isfinite(piece.area_mm2) && std::isfinite(piece.width_mm));
    EXPECT_GE(piece.from.x, -3'100'000);
    EXPECT_LE(piece.to.x, 7'000'000);
    EXPECT_LE(piece.width_mm, 3);
  }
}

}  // namespace
}  // namespace lamina::bead
