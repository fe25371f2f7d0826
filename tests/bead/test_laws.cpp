// Laws that hold for any line: volume, steady states, scaling, limits, and that it does not matter how a stretch is divided.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "stages/bead/line.h"

namespace lamina::bead {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kLayer = 0.3;  // mm

struct DepositedLine {
  std::vector<BeadPiece> pieces;
  Joint end;
  double fed = 0, deposited = 0, seconds = 0;
};

DepositedLine deposit_line(const BeadMachine& machine, const std::vector<LineSegment>& intervals, Joint from, double to,
                           double tolerance = 0.001) {
  DepositedLine result;
  BeadLine line(machine, kLayer, tolerance);
  const auto take = [&](const BeadPiece& piece) { result.pieces.push_back(piece); };
  line.begin(from);
  for (const LineSegment& s : intervals) line.add(s, take);
  result.end = line.end(to, take);
  result.fed = line.fed_mm3();
  result.deposited = line.deposited_mm3();
  result.seconds = line.seconds();
  return result;
}

double area_at(const DepositedLine& line, double position) {
  for (const BeadPiece& p : line.pieces) {
    if (position > p.end_mm) continue;
    const double share = (position - p.begin_mm) / (p.end_mm - p.begin_mm);
    return p.begin_area_mm2 + share * (p.end_area_mm2 - p.begin_area_mm2);
  }
  return line.pieces.back().end_area_mm2;
}

std::vector<LineSegment> random_intervals(unsigned seed, int count = 40) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> length(0.05, 4), area(0.01, 0.2), speed(4, 80);
  std::vector<LineSegment> intervals;
  for (int i = 0; i < count; ++i) intervals.push_back({length(random), area(random), speed(random)});
  return intervals;
}

TEST(BeadLine, WhatIsFedIsDepositedOrHeldByTheLag) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    for (const double acceleration : {100.0, 400.0, 5000.0, kInfinite}) {
      const BeadMachine machine{0.1, 0.01 * seed, acceleration};
      const Joint from{5, 0.1 * seed};
      const DepositedLine line = deposit_line(machine, random_intervals(seed), from, 3);
      const double held = machine.tau_s * (line.end.flow_mm3_s - from.flow_mm3_s);
      EXPECT_NEAR((line.deposited + held) / line.fed, 1, 1e-12) << seed << ' ' << acceleration;
      double pieces = 0, position = 0;
      for (const BeadPiece& piece : line.pieces) {
        EXPECT_EQ(piece.begin_mm, position);  // one after the other, without a gap
        position = piece.end_mm;
        pieces += piece.volume_mm3;
      }
      EXPECT_NEAR(pieces / line.deposited, 1, 1e-12);
    }
  }
}

TEST(BeadLine, VolumeOfAPieceIsTheIntegralOfItsArea) {
  const BeadMachine machine{0.1, 0.05, 400};
  const DepositedLine line = deposit_line(machine, random_intervals(3), {10, 1}, 5, 1e-4);
  double integral = 0;
  for (const BeadPiece& p : line.pieces) integral += (p.end_mm - p.begin_mm) * (p.begin_area_mm2 + p.end_area_mm2) / 2;
  EXPECT_NEAR(integral / line.deposited, 1, 1e-3);
}

TEST(BeadLine, EvenFeedAndSpeedDepositAnEvenBead) {
  const BeadMachine machine{0.1, 0.05, 400};
  const DepositedLine line = deposit_line(machine, {{7, 0.1, 15}, {0.5, 0.1, 15}, {20, 0.1, 15}}, {15, 1.5}, 15);
  EXPECT_LE(line.pieces.size(), 3U);  // nothing changes: one piece a stretch
  for (const BeadPiece& p : line.pieces) {
    EXPECT_NEAR(p.begin_area_mm2, 0.1, 1e-15);
    EXPECT_NEAR(p.end_width_mm, width_of(0.1, true, kLayer), 1e-14);
  }
  EXPECT_NEAR(line.seconds, 27.5 / 15, 1e-12);
}

TEST(BeadLine, WithoutLagTheCommandedAreaIsDepositedRegardlessOfTheSpeed) {
  for (const double acceleration : {400.0, kInfinite}) {
    const auto intervals = random_intervals(7);
    const DepositedLine line = deposit_line({0.1, 0, acceleration}, intervals, {5, 99}, 5);
    double position = 0;
    for (const LineSegment& s : intervals) {
      EXPECT_NEAR(area_at(line, position + s.length_mm / 2), s.area_mm2, 1e-12);
      position += s.length_mm;
    }
    EXPECT_NEAR(line.deposited / line.fed, 1, 1e-13);
  }
}

TEST(BeadLine, AShortLagAndAHighAccelerationComeToTheirLimits) {
  const std::vector<LineSegment> intervals{{3, 0.1, 15}, {3, 0.1, 30}, {3, 0.05, 15}};
  const DepositedLine none = deposit_line({0.1, 0, 400}, intervals, {15, 1.5}, 15),
                      little = deposit_line({0.1, 1e-6, 400}, intervals, {15, 1.5}, 15);
  const DepositedLine at_once = deposit_line({0.1, 0.05, kInfinite}, intervals, {15, 1.5}, 15);
  const DepositedLine fast = deposit_line({0.1, 0.05, 1e9}, intervals, {15, 1.5}, 15);
  for (double position = 0.2; position < 9; position += 0.37) {
    EXPECT_NEAR(area_at(little, position), area_at(none, position), 1e-5) << position;
    EXPECT_NEAR(area_at(fast, position), area_at(at_once, position), 5e-5) << position;
  }
  EXPECT_NEAR(fast.end.flow_mm3_s, at_once.end.flow_mm3_s, 1e-6);
}

TEST(BeadLine, AfterAStepOfSpeedTheAreaComesBackAsAnExponentialOfTheWay) {
  const BeadMachine machine{0.1, 0.05, kInfinite};
  const DepositedLine line = deposit_line(machine, {{2, 0.1, 15}, {10, 0.1, 30}}, {15, 1.5}, 30);
  for (double x = 0.01; x < 10; x += 0.3) {
    const double expected = 0.1 * (1 - 0.5 * std::exp(-x / (30 * 0.05)));
    EXPECT_NEAR(area_at(line, 2 + x), expected, 0.001 * kLayer);
  }
}

TEST(BeadLine, AreasScaleWithTheFeedAndPathsWithTheSquareOfSpeed) {
  const BeadMachine machine{0.1, 0.05, 400};
  auto intervals = random_intervals(11), doubled = intervals, slowed = intervals;
  for (LineSegment& s : doubled) s.area_mm2 *= 2;
  // Half of all speeds in twice the time: a quarter of the acceleration, the same places.
  for (LineSegment& s : slowed) s.speed_mm_s /= 2;
  const DepositedLine line = deposit_line(machine, intervals, {5, 1}, 5), twice = deposit_line(machine, doubled, {5, 2}, 5);
  const DepositedLine slow = deposit_line({0.1, 0.1, 100}, slowed, {2.5, 0.5}, 2.5);
  EXPECT_NEAR(twice.deposited / line.deposited, 2, 1e-12);
  EXPECT_NEAR(twice.end.flow_mm3_s / line.end.flow_mm3_s, 2, 1e-12);
  EXPECT_NEAR(slow.seconds / line.seconds, 2, 1e-12);
  EXPECT_NEAR(slow.deposited / line.deposited, 1, 1e-12);
  EXPECT_NEAR(slow.end.flow_mm3_s / line.end.flow_mm3_s, 0.5, 1e-12);
}

TEST(BeadLine, ItDoesNotMatterHowAnIntervalIsDivided) {
  for (const double acceleration : {100.0, 400.0, kInfinite}) {
    const BeadMachine machine{0.1, 0.05, acceleration};
    const auto whole = random_intervals(5);
    std::vector<LineSegment> divided;
    divided.reserve(4 * whole.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const double share : i % 2 == 0 ? std::vector<double>{0.3, 0.7} : std::vector<double>{0.1, 0.2, 0.3, 0.4}) {
        divided.push_back({share * whole[i].length_mm, whole[i].area_mm2, whole[i].speed_mm_s});
      }
    }
    const DepositedLine a = deposit_line(machine, whole, {5, 1}, 5), b = deposit_line(machine, divided, {5, 1}, 5);
    EXPECT_NEAR(b.deposited / a.deposited, 1, 1e-12);
    EXPECT_NEAR(b.seconds / a.seconds, 1, 1e-12);
    EXPECT_NEAR(b.end.flow_mm3_s / a.end.flow_mm3_s, 1, 1e-9);
    for (double position = 0.111; position < 60; position += 0.731)
      EXPECT_NEAR(area_at(a, position), area_at(b, position), 1e-3);
  }
}

TEST(BeadLine, WidthsBetweenTheEndsOfAPieceAreWithinTheTolerance) {
  for (const double tolerance : {0.01, 0.001, 0.0001}) {
    const BeadMachine machine{0.1, 0.05, 400};
    const auto intervals = random_intervals(9);
    const DepositedLine coarse = deposit_line(machine, intervals, {5, 1}, 5, tolerance),
                        fine = deposit_line(machine, intervals, {5, 1}, 5, 1e-7);
    std::size_t i = 0;
    double worst = 0;
    for (const BeadPiece& p : fine.pieces) {
      while (coarse.pieces[i].end_mm < p.begin_mm + 1e-9) ++i;
      const BeadPiece& q = coarse.pieces[i];
      const double share = (p.begin_mm - q.begin_mm) / (q.end_mm - q.begin_mm);
      worst = std::max(worst, std::abs(q.begin_width_mm + share * (q.end_width_mm - q.begin_width_mm) - p.begin_width_mm));
    }
    EXPECT_LE(worst, tolerance);
    EXPECT_GT(fine.pieces.size(), coarse.pieces.size());
  }
}

TEST(BeadLine, ALineFromRestAndToRestHasFiniteBeads) {
  const DepositedLine line = deposit_line({0.1, 0.05, 400}, {{10, 0.1, 15}}, {0, 0.5}, 0);
  for (const BeadPiece& p : line.pieces) {
    EXPECT_TRUE(std::isfinite(p.begin_width_mm) && std::isfinite(p.end_width_mm));
    EXPECT_GE(p.volume_mm3, 0);
  }
  EXPECT_NEAR(line.deposited + 0.05 * (line.end.flow_mm3_s - 0.5), 1, 1e-12);
  EXPECT_EQ(line.end.speed_mm_s, 0);
}

TEST(BeadLine, ALineThatBeginsWithTheFlowThatItKeepsIsRightAtOnce) {
  const BeadMachine machine{0.1, 0.053, kInfinite};
  const double left = 1.5 * std::exp(-0.1 / machine.tau_s);  // a travel of a tenth of a second
  const DepositedLine late = deposit_line(machine, {{20, 0.1, 15}}, {15, left}, 15),
                      right = deposit_line(machine, {{20, 0.1, 15}}, {15, 1.5}, 15);
  EXPECT_NEAR(right.deposited - late.deposited, missing_at_start(left, 1.5, machine.tau_s), 1e-9);
  EXPECT_LT(late.pieces.front().begin_area_mm2, 0.02);
  EXPECT_NEAR(late.pieces.back().end_area_mm2, 0.1, 1e-9);
}

TEST(BeadLine, ASteadyPatternRepeatsItself) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const double acceleration : {100.0, 400.0, kInfinite}) {
      const BeadMachine machine{0.1, 0.053, acceleration};
      const auto period = random_intervals(seed, 1 + static_cast<int>(seed));
      const Joint joint = steady_joint(machine, kLayer, period);
      const DepositedLine once = deposit_line(machine, period, joint, joint.speed_mm_s);
      EXPECT_NEAR(once.end.flow_mm3_s / joint.flow_mm3_s, 1, 1e-10);
      EXPECT_NEAR(once.deposited / once.fed, 1, 1e-10);  // nothing is gained or lost in a period
      // A long line of the pattern comes to it from any start; it is planned without knowing that it is one.
      std::vector<LineSegment> many;
      for (int i = 0; i < 60; ++i) many.insert(many.end(), period.begin(), period.end());
      const DepositedLine long_line = deposit_line(machine, many, {joint.speed_mm_s, 0}, joint.speed_mm_s);
      EXPECT_NEAR(long_line.end.flow_mm3_s / joint.flow_mm3_s, 1, 1e-9) << seed << ' ' << acceleration;
    }
  }
}

}  // namespace
}  // namespace lamina::bead
