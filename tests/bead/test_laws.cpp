// Laws that hold for any line: volume, steady states, scaling, limits, and that it does not matter how a stretch is divided.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "stages/bead/line.h"
#include "stages/bead/section.h"

namespace lamina::bead {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kLayer = 0.3;  // mm

struct LaidLine {
  std::vector<BeadPiece> pieces;
  Joint end;
  double fed = 0, laid = 0, seconds = 0;
};

LaidLine lay_line(const BeadMachine& machine, const std::vector<Stretch>& stretches, Joint from, double to,
                  double tolerance = 0.001) {
  LaidLine result;
  BeadLine line(machine, kLayer, tolerance);
  const auto take = [&](const BeadPiece& piece) { result.pieces.push_back(piece); };
  line.begin(from);
  for (const Stretch& s : stretches) line.add(s, take);
  result.end = line.end(to, take);
  result.fed = line.fed_mm3();
  result.laid = line.laid_mm3();
  result.seconds = line.seconds();
  return result;
}

double area_at(const LaidLine& line, double place) {
  for (const BeadPiece& p : line.pieces) {
    if (place > p.end_mm) continue;
    const double share = (place - p.begin_mm) / (p.end_mm - p.begin_mm);
    return p.begin_area_mm2 + share * (p.end_area_mm2 - p.begin_area_mm2);
  }
  return line.pieces.back().end_area_mm2;
}

std::vector<Stretch> random_stretches(unsigned seed, int count = 40) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> length(0.05, 4), area(0.01, 0.2), speed(4, 80);
  std::vector<Stretch> stretches;
  for (int i = 0; i < count; ++i) stretches.push_back({length(random), area(random), speed(random)});
  return stretches;
}

TEST(BeadLine, WhatIsFedIsLaidOrHeldByTheLag) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    for (const double acceleration : {100.0, 400.0, 5000.0, kInfinite}) {
      const BeadMachine machine{0.1, 0.01 * seed, acceleration};
      const Joint from{5, 0.1 * seed};
      const LaidLine line = lay_line(machine, random_stretches(seed), from, 3);
      const double held = machine.tau_s * (line.end.flow_mm3_s - from.flow_mm3_s);
      EXPECT_NEAR((line.laid + held) / line.fed, 1, 1e-12) << seed << ' ' << acceleration;
      double pieces = 0, place = 0;
      for (const BeadPiece& piece : line.pieces) {
        EXPECT_EQ(piece.begin_mm, place);  // one after the other, without a gap
        place = piece.end_mm;
        pieces += piece.volume_mm3;
      }
      EXPECT_NEAR(pieces / line.laid, 1, 1e-12);
    }
  }
}

TEST(BeadLine, VolumeOfAPieceIsTheIntegralOfItsArea) {
  const BeadMachine machine{0.1, 0.05, 400};
  const LaidLine line = lay_line(machine, random_stretches(3), {10, 1}, 5, 1e-4);
  double integral = 0;
  for (const BeadPiece& p : line.pieces) integral += (p.end_mm - p.begin_mm) * (p.begin_area_mm2 + p.end_area_mm2) / 2;
  EXPECT_NEAR(integral / line.laid, 1, 1e-3);
}

TEST(BeadLine, EvenFeedAndSpeedLayAnEvenBead) {
  const BeadMachine machine{0.1, 0.05, 400};
  const LaidLine line = lay_line(machine, {{7, 0.1, 15}, {0.5, 0.1, 15}, {20, 0.1, 15}}, {15, 1.5}, 15);
  EXPECT_LE(line.pieces.size(), 3U);  // nothing changes: one piece a stretch
  for (const BeadPiece& p : line.pieces) {
    EXPECT_NEAR(p.begin_area_mm2, 0.1, 1e-15);
    EXPECT_NEAR(p.end_width_mm, width_of(0.1, true, kLayer), 1e-14);
  }
  EXPECT_NEAR(line.seconds, 27.5 / 15, 1e-12);
}

TEST(BeadLine, WithoutLagTheCommandedAreaIsLaidWhateverTheSpeed) {
  for (const double acceleration : {400.0, kInfinite}) {
    const auto stretches = random_stretches(7);
    const LaidLine line = lay_line({0.1, 0, acceleration}, stretches, {5, 99}, 5);
    double place = 0;
    for (const Stretch& s : stretches) {
      EXPECT_NEAR(area_at(line, place + s.length_mm / 2), s.area_mm2, 1e-12);
      place += s.length_mm;
    }
    EXPECT_NEAR(line.laid / line.fed, 1, 1e-13);
  }
}

TEST(BeadLine, AShortLagAndAHighAccelerationComeToTheirLimits) {
  const std::vector<Stretch> stretches{{3, 0.1, 15}, {3, 0.1, 30}, {3, 0.05, 15}};
  const LaidLine none = lay_line({0.1, 0, 400}, stretches, {15, 1.5}, 15),
                 little = lay_line({0.1, 1e-6, 400}, stretches, {15, 1.5}, 15);
  const LaidLine at_once = lay_line({0.1, 0.05, kInfinite}, stretches, {15, 1.5}, 15);
  const LaidLine fast = lay_line({0.1, 0.05, 1e9}, stretches, {15, 1.5}, 15);
  for (double place = 0.2; place < 9; place += 0.37) {
    EXPECT_NEAR(area_at(little, place), area_at(none, place), 1e-5) << place;
    EXPECT_NEAR(area_at(fast, place), area_at(at_once, place), 5e-5) << place;
  }
  EXPECT_NEAR(fast.end.flow_mm3_s, at_once.end.flow_mm3_s, 1e-6);
}

TEST(BeadLine, AfterAStepOfSpeedTheAreaComesBackAsAnExponentialOfTheWay) {
  const BeadMachine machine{0.1, 0.05, kInfinite};
  const LaidLine line = lay_line(machine, {{2, 0.1, 15}, {10, 0.1, 30}}, {15, 1.5}, 30);
  for (double x = 0.01; x < 10; x += 0.3) {
    const double expected = 0.1 * (1 - 0.5 * std::exp(-x / (30 * 0.05)));
    EXPECT_NEAR(area_at(line, 2 + x), expected, 0.001 * kLayer);
  }
}

TEST(BeadLine, AreasScaleWithTheFeedAndWaysWithTheSquareOfSpeed) {
  const BeadMachine machine{0.1, 0.05, 400};
  auto stretches = random_stretches(11), doubled = stretches, slowed = stretches;
  for (Stretch& s : doubled) s.area_mm2 *= 2;
  // Half of all speeds in twice the time: a quarter of the acceleration, the same places.
  for (Stretch& s : slowed) s.speed_mm_s /= 2;
  const LaidLine line = lay_line(machine, stretches, {5, 1}, 5), twice = lay_line(machine, doubled, {5, 2}, 5);
  const LaidLine slow = lay_line({0.1, 0.1, 100}, slowed, {2.5, 0.5}, 2.5);
  EXPECT_NEAR(twice.laid / line.laid, 2, 1e-12);
  EXPECT_NEAR(twice.end.flow_mm3_s / line.end.flow_mm3_s, 2, 1e-12);
  EXPECT_NEAR(slow.seconds / line.seconds, 2, 1e-12);
  EXPECT_NEAR(slow.laid / line.laid, 1, 1e-12);
  EXPECT_NEAR(slow.end.flow_mm3_s / line.end.flow_mm3_s, 0.5, 1e-12);
}

TEST(BeadLine, ItDoesNotMatterHowAStretchIsDivided) {
  for (const double acceleration : {100.0, 400.0, kInfinite}) {
    const BeadMachine machine{0.1, 0.05, acceleration};
    const auto whole = random_stretches(5);
    std::vector<Stretch> divided;
    divided.reserve(4 * whole.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const double share : i % 2 == 0 ? std::vector<double>{0.3, 0.7} : std::vector<double>{0.1, 0.2, 0.3, 0.4}) {
        divided.push_back({share * whole[i].length_mm, whole[i].area_mm2, whole[i].speed_mm_s});
      }
    }
    const LaidLine a = lay_line(machine, whole, {5, 1}, 5), b = lay_line(machine, divided, {5, 1}, 5);
    EXPECT_NEAR(b.laid / a.laid, 1, 1e-12);
    EXPECT_NEAR(b.seconds / a.seconds, 1, 1e-12);
    EXPECT_NEAR(b.end.flow_mm3_s / a.end.flow_mm3_s, 1, 1e-9);
    for (double place = 0.111; place < 60; place += 0.731) EXPECT_NEAR(area_at(a, place), area_at(b, place), 1e-3);
  }
}

TEST(BeadLine, WidthsBetweenTheEndsOfAPieceAreWithinTheTolerance) {
  for (const double tolerance : {0.01, 0.001, 0.0001}) {
    const BeadMachine machine{0.1, 0.05, 400};
    const auto stretches = random_stretches(9);
    const LaidLine coarse = lay_line(machine, stretches, {5, 1}, 5, tolerance),
                   fine = lay_line(machine, stretches, {5, 1}, 5, 1e-7);
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
  const LaidLine line = lay_line({0.1, 0.05, 400}, {{10, 0.1, 15}}, {0, 0.5}, 0);
  for (const BeadPiece& p : line.pieces) {
    EXPECT_TRUE(std::isfinite(p.begin_width_mm) && std::isfinite(p.end_width_mm));
    EXPECT_GE(p.volume_mm3, 0);
  }
  EXPECT_NEAR(line.laid + 0.05 * (line.end.flow_mm3_s - 0.5), 1, 1e-12);
  EXPECT_EQ(line.end.speed_mm_s, 0);
}

TEST(BeadLine, ALineThatBeginsWithTheFlowThatItKeepsIsRightAtOnce) {
  const BeadMachine machine{0.1, 0.053, kInfinite};
  const double left = 1.5 * std::exp(-0.1 / machine.tau_s);  // a travel of a tenth of a second
  const LaidLine late = lay_line(machine, {{20, 0.1, 15}}, {15, left}, 15),
                 right = lay_line(machine, {{20, 0.1, 15}}, {15, 1.5}, 15);
  EXPECT_NEAR(right.laid - late.laid, missing_at_start(left, 1.5, machine.tau_s), 1e-9);
  EXPECT_LT(late.pieces.front().begin_area_mm2, 0.02);
  EXPECT_NEAR(late.pieces.back().end_area_mm2, 0.1, 1e-9);
}

TEST(BeadLine, ASteadyPatternRepeatsItself) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    for (const double acceleration : {100.0, 400.0, kInfinite}) {
      const BeadMachine machine{0.1, 0.053, acceleration};
      const auto period = random_stretches(seed, 1 + static_cast<int>(seed));
      const Joint joint = steady_joint(machine, kLayer, period);
      const LaidLine once = lay_line(machine, period, joint, joint.speed_mm_s);
      EXPECT_NEAR(once.end.flow_mm3_s / joint.flow_mm3_s, 1, 1e-10);
      EXPECT_NEAR(once.laid / once.fed, 1, 1e-10);  // nothing is gained or lost in a period
      // A long line of the pattern comes to it from any start; it is planned without knowing that it is one.
      std::vector<Stretch> many;
      for (int i = 0; i < 60; ++i) many.insert(many.end(), period.begin(), period.end());
      const LaidLine long_line = lay_line(machine, many, {joint.speed_mm_s, 0}, joint.speed_mm_s);
      EXPECT_NEAR(long_line.end.flow_mm3_s / joint.flow_mm3_s, 1, 1e-9) << seed << ' ' << acceleration;
    }
  }
}

}  // namespace
}  // namespace lamina::bead
