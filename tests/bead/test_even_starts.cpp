// Lines begin with the flow they keep: by the model of a bead, and by sums that do not depend on it.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/bead/deposition.h"
#include "stages/bead/even_starts.h"
#include "stages/geometry/bead_section.h"

namespace lamina::bead {
namespace {

constexpr double kStartArea = 0.102, kStartHeight = 0.3, kStartLag = 0.046;  // mm2, mm, s

Extruder lagging_machine() {
  Extruder machine;
  machine.material.lag_s = kStartLag;
  machine.speed.acceleration_mm_s2 = 1e6;  // speeds change at once: what is left is the lag
  return machine;
}

BeadMove line_at(double y_mm, double speed, bool jump, double from_mm = 0, double to_mm = 12) {
  const auto at = [&](double x) {
    return Point2{static_cast<Nm>(std::lround(x * 1e6)), static_cast<Nm>(std::lround(y_mm * 1e6))};
  };
  return {at(from_mm), at(to_mm), PathKind::kRaster, jump, 400'000, kStartArea, speed, true};
}

/// What a file of these moves is read as, made even or not.
struct Commanded {
  Buffer<DepositedBead> beads;
  Buffer<BeadFeed> feeds;

  DepositedMove deposit(const BeadMove& move) {
    const double length = std::hypot(mm(move.to.x - move.from.x), mm(move.to.y - move.from.y));
    beads.push_back({move.from, move.to, move.width, 0});
    feeds.push_back({move.area_mm2 * length, move.speed_mm_s, !move.jump, 0});
    return {length, length * move.area_mm2};
  }
  double fed() const {
    double sum = 0;
    for (const BeadFeed& feed : feeds) sum += feed.volume_mm3;
    return sum;
  }
};

Commanded commanded(const std::vector<BeadMove>& moves, bool even) {
  Commanded file;
  EvenStarts starts(lagging_machine(), kStartHeight);
  for (const BeadMove& move : moves) {
    const auto deposit = [&](const BeadMove& m) -> std::optional<DepositedMove> { return file.deposit(m); };
    const std::optional<DepositedMove> deposited = even ? starts.deposit(move, deposit) : deposit(move);
    EXPECT_NEAR(deposited->length_mm, mm(move.to.x - move.from.x), 1e-9);
  }
  return file;
}

/// The width farthest from that of the even bead, from `from` to `to` along the line at a height y.
double farthest_width(const Commanded& file, double y_mm, double from_mm, double to_mm) {
  DepositionRules rules;
  rules.machine = {0, kStartLag, 1e6};
  rules.corner_mm_s = 1e3;
  rules.height_mm = kStartHeight;
  Buffer<DepositedPiece> pieces;
  deposit(file.beads, file.feeds, rules, pieces);
  double farthest = 0;
  for (const DepositedPiece& piece : pieces)
    if (std::abs(mm(piece.from.y) - y_mm) < 1e-6 && mm(piece.from.x) >= from_mm && mm(piece.to.x) <= to_mm)
      farthest = std::max(farthest, std::abs(piece.width_mm - bead_width(kStartArea, kStartHeight)));
  return farthest;
}

/// Wherever the line before ended, and whether the nozzle travels in between.
TEST(EvenStarts, ALineIsEvenAfterItsFirstPiece) {
  for (const bool jump : {true, false})
    for (const auto& [before, after] : {std::pair{11.0, 30.0}, {30.0, 11.0}, {15.0, 12.0}, {3.0, 60.0}, {60.0, 5.0}}) {
      const std::vector<BeadMove> moves = {line_at(0, before, true, 0, 30), line_at(0, after, jump, 30, 60)};
      const Commanded even = commanded(moves, true);
      ASSERT_EQ(even.beads.size(), 3u);
      const double begin = mm(even.beads[1].to.x);
      EXPECT_LE(begin, 30 + std::max(0.2, 4 * kStartLag * after));
      EXPECT_LT(farthest_width(even, 0, begin, 60), 0.002) << before << " to " << after;
      EXPECT_GT(farthest_width(commanded(moves, false), 0, begin, 60), 0.01) << before << " to " << after;
      EXPECT_GE(even.feeds[1].volume_mm3, 0);
      EXPECT_LE(even.feeds[1].volume_mm3, 3.001 * kStartArea * (begin - 30)) << "no more than thrice the feed";
    }
}

/// Curves of short chords, and links that end before the line is even.
TEST(EvenStarts, ShortMovesTogetherMakeALineEven) {
  for (const auto& [before, after] : {std::pair{15.0, 40.0}, {40.0, 12.0}, {60.0, 5.0}}) {
    std::vector<BeadMove> moves = {line_at(0, before, true, 0, 30)};
    for (int i = 0; i < 200; ++i) {
      moves.push_back(line_at(0, after, i == 0, 30 + 0.1 * i, 30 + 0.1 * (i + 1)));
      moves.back().begins = i == 0;
    }
    const Commanded even = commanded(moves, true);
    for (std::size_t i = 0; i < even.feeds.size(); ++i)
      EXPECT_GT(even.feeds[i].volume_mm3, 0) << "a move without a feed is a travel";
    const double way = std::max(0.2, kStartLag * after * std::log(before > after ? (before / after - 0.05) / 0.95 : 3 / 2.0));
    EXPECT_LT(farthest_width(even, 0, 30 + way + 0.31, 50), 0.004) << before << " to " << after;
    EXPECT_GT(farthest_width(commanded(moves, false), 0, 30 + way + 0.31, 50), 0.01);
  }
}

TEST(EvenStarts, ALinkThatIsTooShortLeavesTheRestToTheLineBehindIt) {
  const std::vector<BeadMove> moves = {line_at(0, 40, true, 0, 30), line_at(0, 15, false, 30, 30.07),
                                       line_at(0, 10, false, 30.07, 60)};
  EXPECT_LT(farthest_width(commanded(moves, true), 0, 32, 60), 0.002);
  EXPECT_LT(farthest_width(commanded(moves, true), 0, 31.2, 60), 0.6 * farthest_width(commanded(moves, false), 0, 31.2, 60));
}

/// By the equation of the lag alone, in steps of a millionth of a second: the flow where the first piece of a line ends.
TEST(EvenStarts, TheEquationOfTheLagStepByStepGivesTheFlowOfTheLine) {
  for (const auto& [before, after] : {std::pair{11.0, 30.0}, {30.0, 11.0}, {60.0, 5.0}}) {
    const Commanded even = commanded({line_at(0, before, true, 0, 12), line_at(0, after, true, 12, 24)}, true);
    ASSERT_EQ(even.beads.size(), 3u);
    constexpr double kStep = 1e-6;
    double flow = kStartArea * before;  // of a line that is even
    const double feed = even.feeds[1].volume_mm3 / (mm(even.beads[1].to.x - even.beads[1].from.x) / after);
    const double seconds = mm(even.beads[1].to.x - even.beads[1].from.x) / after;
    for (double t = 0; t < seconds; t += kStep) flow += kStep * (feed - flow) / kStartLag;
    EXPECT_NEAR(flow / (kStartArea * after), 1, 1e-3) << before << " to " << after;
  }
}

/// What lines lend each other comes back, but for what runs out behind faster lines before a slow one is even: by hand, for
/// half the speed, lag x rise of the flow x (1 - ln 2) at least.
TEST(EvenStarts, WhatIsFedInAllStaysNearlyTheSame) {
  std::vector<BeadMove> moves;
  for (int i = 0; i < 9; ++i) moves.push_back(line_at(i, i % 2 == 0 ? 15 : 30, i % 3 != 1));
  const double more = commanded(moves, true).fed() - commanded(moves, false).fed();
  EXPECT_GT(more, 4 * kStartLag * kStartArea * 15 * (1 - std::log(2.0)) * 0.6);
  EXPECT_LT(more, 4 * kStartLag * kStartArea * 15 * (1 - std::log(2.0)));
}

TEST(EvenStarts, LinesOfOneSpeedAndThoseWithinALineAreLeftAlone) {
  std::vector<BeadMove> moves = {line_at(0, 15, true), line_at(1, 15, true), line_at(1, 30, false, 12, 14)};
  moves[2].begins = false;
  const Commanded even = commanded(moves, true);
  ASSERT_EQ(even.beads.size(), 3u);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(even.feeds[i].volume_mm3, commanded(moves, false).feeds[i].volume_mm3);
}

}  // namespace
}  // namespace lamina::bead
