// The width of a bead by its cross-section and by what is fed; the speed of the head at the joints of a line.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "stages/bead/line.h"

namespace lamina::bead {
namespace {

TEST(Section, WidthsAreThoseOfTheirShapes) {
  EXPECT_NEAR(width_of(bead_area(0.4, 0.3), false, 0.3), 0.4, 1e-15);               // a stadium
  EXPECT_NEAR(width_of(3.14159265358979 / 4 * 0.2 * 0.3, true, 0.3), 0.2, 1e-14);   // an ellipse as high as the layer
  EXPECT_NEAR(width_of(3.14159265358979 / 4 * 0.2 * 0.2, false, 0.3), 0.2, 1e-14);  // a circle
  const double circle = full_circle(0.3);
  for (const bool pressed : {false, true}) {  // they meet where the bead is as wide as high
    EXPECT_NEAR(width_of(circle * (1 - 1e-12), pressed, 0.3), 0.3, 1e-11);
    EXPECT_EQ(width_of(circle, pressed, 0.3), 0.3);
    EXPECT_EQ(width_of(0, pressed, 0.3), 0);
    double before = 0;
    for (double area = 0.001; area < 0.3; area += 0.001) {
      EXPECT_GT(width_of(area, pressed, 0.3), before);
      before = width_of(area, pressed, 0.3);
      EXPECT_NEAR(width_of(4 * area, pressed, 0.6), 2 * before, 1e-12);  // twice as large a picture
    }
  }
  for (double width = 0.05; width < 1.5; width += 0.05) EXPECT_NEAR(width_of(bead_area(width, 0.3), false, 0.3), width, 1e-12);
}

TEST(Section, AStarvedBeadStaysPressedAnUnderfedOneLetsGoUntilTheLayerIsFilledAgain) {
  EXPECT_TRUE(stays_pressed(0.05, 0.1, true, 0.3));
  EXPECT_FALSE(stays_pressed(0.05, 0.05, true, 0.3));
  EXPECT_FALSE(stays_pressed(0.05, 0.1, false, 0.3));
  EXPECT_TRUE(stays_pressed(0.08, 0.05, false, 0.3));
}

/// Speeds at all joints when the whole line is known.
std::vector<double> whole_plan(const std::vector<LineSegment>& line, double begin, double end, double acceleration) {
  std::vector<double> speed(line.size() + 1);
  speed[0] = std::min(begin, line[0].speed_mm_s);
  speed[line.size()] = std::min(end, line.back().speed_mm_s);
  for (std::size_t i = 1; i < line.size(); ++i) speed[i] = std::min(line[i - 1].speed_mm_s, line[i].speed_mm_s);
  const auto reach = [&](double from, const LineSegment& s) { return std::sqrt(from * from + 2 * acceleration * s.length_mm); };
  for (std::size_t i = line.size(); i-- > 1;) speed[i] = std::min(speed[i], reach(speed[i + 1], line[i]));
  for (std::size_t i = 1; i <= line.size(); ++i) speed[i] = std::min(speed[i], reach(speed[i - 1], line[i - 1]));
  return speed;
}

TEST(SpeedPlan, ItIsThatOfTheWholeLineAndWaitsABrakingDistance) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> length(0.02, 1.5), speed(2, 80);
  for (const double acceleration : {50.0, 400.0, 3000.0}) {
    std::vector<LineSegment> line;
    for (int i = 0; i < 500; ++i) line.push_back({length(random), 0.1, speed(random)});
    const auto expected = whole_plan(line, 4, 4, acceleration);
    SpeedPlan plan(acceleration);
    plan.begin(4);
    std::size_t taken = 0;
    const auto check = [&](const Planned& p) {
      EXPECT_NEAR(p.begin_mm_s, expected[taken], 1e-9);
      EXPECT_NEAR(p.end_mm_s, expected[taken + 1], 1e-9);
      EXPECT_LE(p.peak(acceleration), p.segment.speed_mm_s);
      EXPECT_EQ(p.segment.length_mm, line[taken++].length_mm);
    };
    Planned planned{};
    for (const LineSegment& s : line) {
      plan.add(s);
      while (plan.take(planned)) check(planned);
      double waits = 0;
      for (std::size_t i = taken + 1; i < taken + plan.waiting(); ++i) waits += line[i].length_mm;
      EXPECT_LE(waits, 80 * 80 / (2 * acceleration) + 1.5);
    }
    while (plan.waiting() > 0) {
      ASSERT_TRUE(plan.take_last(4, planned));
      check(planned);
    }
    EXPECT_EQ(taken, line.size());
    EXPECT_FALSE(plan.take_last(4, planned));
  }
}

TEST(SpeedPlan, APatternBeginsAsFastAsOneThatIsLongRepeated) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> length(0.02, 1.5), speed(2, 80);
  for (int pattern = 0; pattern < 50; ++pattern) {
    std::vector<LineSegment> period, line;
    for (int i = 0; i <= pattern % 7; ++i) period.push_back({length(random), 0.1, speed(random)});
    for (int i = 0; i < 200; ++i) line.insert(line.end(), period.begin(), period.end());
    EXPECT_NEAR(cyclic_speed(period, 200), whole_plan(line, 1, 1, 200)[100 * period.size()], 1e-9);
  }
  EXPECT_EQ(cyclic_speed({}, 400), 0);
}

}  // namespace
}  // namespace lamina::bead
