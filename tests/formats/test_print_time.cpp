// The time of moves by the rules of Marlin and Klipper, hand-calculated. tests/segment/print_time has the same cases.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/formats/gcode/print_time.h"
#include "stages/formats/gcode/write_gcode.h"

namespace lamina::formats::gcode {
namespace {

struct TimedMove {
  PrintTime::Delta delta;
  double speed;
};

Extruder timed_machine(const std::string& flavor) {
  Extruder machine;  // 1000 mm/s2, corners 8 mm/s, nozzle 0.4 mm, filament 1.75 mm
  machine.code.flavor = flavor;
  return machine;
}

double seconds_of(const std::string& flavor, const std::vector<TimedMove>& moves) {
  PrintTime time(timed_machine(flavor));
  for (const TimedMove& move : moves) time.move(move.delta, move.speed);
  return time.halt();
}

double marlin(const std::vector<TimedMove>& moves) { return seconds_of("Marlin", moves); }
double klipper(const std::vector<TimedMove>& moves) { return seconds_of("Klipper", moves); }

// 60 mm/s are reached from a halt in 0.06 s and 1.8 mm, from 8 mm/s in 0.052 s and 1.768 mm. Marlin begins with the corner speed.
TEST(PrintTime, OneMoveHasTwoRamps) {
  EXPECT_NEAR(marlin({{{60, 0, 0, 0}, 60}}), 0.052 + 0.06 + (60 - 1.768 - 1.8) / 60, 1e-9);
  EXPECT_NEAR(klipper({{{60, 0, 0, 0}, 60}}), 0.12 + (60 - 3.6) / 60, 1e-9);
}

// Over 1 mm, from 8 to 0: peak^2 = (64 + 2000) / 2. Klipper: minimum_cruise_ratio 0.5 leaves 0.25 mm for each ramp.
TEST(PrintTime, AShortMoveDoesNotReachItsSpeed) {
  EXPECT_NEAR(marlin({{{1, 0, 0, 0}, 60}}), (2 * std::sqrt(1032) - 8) / 1000, 1e-9);
  const double peak = std::sqrt(2 * 1000 * 0.25);
  EXPECT_NEAR(klipper({{{1, 0, 0, 0}, 60}}), 2 * peak / 1000 + 0.5 / peak, 1e-9);
}

// Marlin's limit is that of each axis, so it depends on the direction; Klipper's square corner velocity does not.
TEST(PrintTime, ARightAngleIsPassedWithTheCornerSpeedOfTheAxes) {
  const double ramps = 0.052 * 3 + 0.06, way = 1.768 * 3 + 1.8;
  EXPECT_NEAR(marlin({{{10, 0, 0, 0}, 60}, {{0, 10, 0, 0}, 60}}), ramps + (20 - way) / 60, 1e-9);
  const double both = 0.06 * 2 + 0.052 * 2 + (20 - 2 * 1.8 - 2 * 1.768) / 60;
  EXPECT_NEAR(klipper({{{10, 0, 0, 0}, 60}, {{0, 10, 0, 0}, 60}}), both, 1e-9);
  const double side = 10 * std::sqrt(0.5);
  EXPECT_NEAR(klipper({{{side, side, 0, 0}, 60}, {{side, -side, 0, 0}, 60}}), both, 1e-9);
  // One axis changes by sqrt 2 times the speed: 5.657 mm/s. The first move begins with 8 in each axis, 11.314 mm/s.
  const double first = std::sqrt(128.0), corner = std::sqrt(32.0);
  EXPECT_NEAR(marlin({{{side, side, 0, 0}, 60}, {{side, -side, 0, 0}, 60}}),
              (60 - first) / 1000 + 2 * (60 - corner) / 1000 + 0.06 + (20 - (3600 - 128) / 2000.0 - (3600 - 32) / 1000.0 - 1.8) / 60,
              1e-9);
}

// Back and forth over 1 mm: the axis changes by twice the speed, 4 mm/s. Speeds 8, 4, 4, 0; twice the squared peaks 2080, 2032, 2016.
TEST(PrintTime, AZigzagTurnsWithHalfTheCornerSpeed) {
  const std::vector<TimedMove> moves = {{{1, 0, 0, 0}, 60}, {{-1, 0, 0, 0}, 60}, {{1, 0, 0, 0}, 60}};
  EXPECT_NEAR(marlin(moves), (2 * std::sqrt(1040) - 12 + 2 * std::sqrt(1016) - 8 + 2 * std::sqrt(1008) - 4) / 1000, 1e-9);
}

// The filament takes 1 mm at 40 mm/s: from 8 to 8 its peak^2 is 1064, to a halt 1032. 150 mm/s are reached from 8 in 0.142 s and 11.218 mm.
// Klipper halts at all joints and gives the filament 4 x 0.16 / 2.40528 of 1000 mm/s2.
TEST(PrintTime, RetractionTakesItsAccelerationAndTheTravelItsOwn) {
  const std::vector<TimedMove> moves = {{{0, 0, 0, -1}, 40}, {{30, 0, 0, 0}, 150}, {{0, 0, 0, 1}, 40}};
  EXPECT_NEAR(marlin(moves),
              (2 * std::sqrt(1064) - 16) / 1000 + 2 * 0.142 + (30 - 22.436) / 150 + (2 * std::sqrt(1032) - 8) / 1000, 1e-9);
  // The travel's ramps may take half of it, 7.5 mm each: 122.474 mm/s.
  const double peak = std::sqrt(2 * 1000 * 7.5);
  EXPECT_NEAR(klipper(moves), 4 * std::sqrt(2.405281875 / 640) + 2 * peak / 1000 + 15 / peak, 1e-6);
}

// 0.2 mm up at 10 mm/s: from 8 in 0.002 s and 0.018 mm, to a halt in 0.01 s and 0.05 mm.
TEST(PrintTime, TheAxisOfHeightHasTheSameLimits) {
  EXPECT_NEAR(marlin({{{0, 0, 0.2, 0}, 10}}), 0.012 + (0.2 - 0.068) / 10, 1e-9);
  EXPECT_NEAR(klipper({{{0, 0, 0.2, 0}, 10}}), 0.02 + (0.2 - 0.1) / 10, 1e-9);
}

// An arc in chords: 120 of 1 degree over a radius of 20 mm. Marlin: a chord turns by 2 sin 0.5 degrees x 60 mm/s = 1.05 mm/s, below 8, so
// the arc keeps 60 mm/s. Klipper: v^2 <= a chord / 2 tan(turn / 2) of mid-move contact is 0.5 x 1000 x 2 x 20 / 2 = 20000 / 2 > 3600.
TEST(PrintTime, AnArcOfManyChordsIsOneMove) {
  std::vector<TimedMove> moves;
  const double degree = std::acos(-1.0) / 180, chord = 2 * 20 * std::sin(degree / 2);
  for (int i = 0; i < 120; ++i) moves.push_back({{chord * std::cos(i * degree), chord * std::sin(i * degree), 0, 0}, 60});
  EXPECT_NEAR(marlin(moves), 0.112 + (120 * chord - 1.768 - 1.8) / 60, 1e-6);
  EXPECT_NEAR(klipper(moves), 0.12 + (120 * chord - 3.6) / 60, 1e-6);
}

// A line of 0.02 mm chords is longer than what is planned at once; it takes as long as one move.
TEST(PrintTime, ThousandsOfChordsInALineAreOneMove) {
  for (const char* flavor : {"Marlin", "Klipper"}) {
    for (const double speed : {10.0, 40.0}) {
      const std::vector<TimedMove> chords(5000, {{0.02, 0, 0, 0.002}, speed});
      EXPECT_NEAR(seconds_of(flavor, chords), seconds_of(flavor, {{{100, 0, 0, 10}, speed}}), 1e-6) << flavor << ' ' << speed;
    }
  }
}

TEST(PrintTime, ATinyFirstMoveEndsInAHalt) {
  EXPECT_NEAR(marlin({{{0.001, 0, 0, 0}, 60}}), std::sqrt(2 * 0.001 / 1000), 1e-9);
  EXPECT_EQ(marlin({{{0, 0, 0, 0}, 60}}), 0);
}

// The travel to the next layer belongs to no writer of a layer: 30 mm at 120 mm/s from halt to halt, 2 x 0.12 s and 30 - 14.4 mm.
TEST(PrintTime, TravelsBetweenLayersAreAdded) {
  const Extruder machine = timed_machine("Marlin");
  const auto format = make_gcode_format(machine);
  Buffer<char> out;
  const auto layer = [&](std::uint32_t index, Nm x) {
    LayerWriter writer(machine, {index, static_cast<Nm>(index) * 200'000, 200'000}, 2, out);
    writer.deposit({{x, 0}, {x + 10'000'000, 0}, PathKind::kRaster, true, 400'000, 0.1, 50});
    return writer.finish();
  };
  MoveTotals all;
  all.add(layer(0, 0));
  const MoveTotals alone = layer(1, 40'000'000);
  MoveTotals second = alone;
  format->travel_from(all, second);
  EXPECT_NEAR(second.seconds - alone.seconds, 0.24 + (30 - 14.4) / 120, 1e-9);
  EXPECT_NEAR(second.travel_mm - alone.travel_mm, 30, 1e-9);
  all.add(second);
  EXPECT_EQ(all.last.x, 50'000'000);
  MoveTotals empty;
  format->travel_from(all, empty);
  EXPECT_EQ(empty.seconds, 0);
  all.add(empty);
  EXPECT_EQ(all.last.x, 50'000'000);
  MoveTotals first = alone;
  format->travel_from(MoveTotals(), first);
  EXPECT_EQ(first.seconds, alone.seconds);
}

}  // namespace
}  // namespace lamina::formats::gcode
