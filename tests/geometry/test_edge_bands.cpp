// tests/geometry/test_edge_bands.cpp: regions within others, against boolean operations.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/edge_bands.h"

namespace lamina::test {
namespace {

Contours star(std::mt19937& random, Nm x, Nm y, double radius, bool hole) {
  Contours contours;
  std::uniform_real_distribution<double> share(0.6, 1);
  constexpr int kCorners = 14;
  for (int i = 0; i < kCorners; ++i) {
    const double angle = 2 * M_PI * i / kCorners, r = radius * share(random);
    contours.point.push_back(
        {x + static_cast<Nm>(std::llround(r * std::cos(angle))), y + static_cast<Nm>(std::llround(r * std::sin(angle)))});
  }
  contours.close();
  if (hole) {
    const Nm d = static_cast<Nm>(radius / 8);
    for (const Point2 p : {Point2{x - d, y - d}, {x - d, y + d}, {x + d, y + d}, {x + d, y - d}}) contours.point.push_back(p);
    contours.close();
  }
  return contours;
}

// Yes is proved by an empty difference; edges far from each other get no wrong No.
TEST(ContainmentTest, AgreesWithBooleanOperations) {
  std::mt19937 random(11);
  std::uniform_int_distribution<Nm> coordinate(-9'000'000, 9'000'000);
  int within = 0, outside = 0, in_holes = 0;
  for (int round = 0; round < 400; ++round) {
    const Contours outer = star(random, 0, 0, 10e6, round % 2 == 0);
    const Contours inner = star(random, coordinate(random), coordinate(random), round % 3 == 0 ? 0.5e6 : 3e6, round % 5 == 0);
    ContainmentTest test;
    test.set_inner(inner);
    const auto rest = subtract_contours(inner, outer);
    ASSERT_TRUE(rest.ok());
    const bool truly = doubled_area(*rest) == 0;
    EXPECT_EQ(test.certainly_in(outer), truly) << round;
    within += truly;
    outside += !truly;
    in_holes += !truly && is_inside(outer[0], inner[0].front());
  }
  EXPECT_GT(within, 50);
  EXPECT_GT(outside, 50);
  EXPECT_GT(in_holes, 5);
}

// A hole or an island of the outer region inside the inner one, without an edge in common.
TEST(ContainmentTest, FindsHolesInsideTheInnerRegion) {
  std::mt19937 random(5);
  const Contours outer = star(random, 0, 0, 10e6, true), inner = star(random, 0, 0, 4e6, false), none;
  ContainmentTest test;
  test.set_inner(inner);
  EXPECT_FALSE(test.certainly_in(outer));
  EXPECT_FALSE(test.certainly_in(none));
  test.set_inner(none);
  EXPECT_TRUE(test.certainly_in(outer));
}

}  // namespace
}  // namespace lamina::test
