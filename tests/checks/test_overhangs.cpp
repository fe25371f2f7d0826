// Overhangs of rectangles, rings and polygons against hand-calculated areas.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "stages/checks/overhang_tally.h"
#include "stages/checks/overhangs.h"
#include "stages/geometry/clipping.h"

namespace lamina::checks {
namespace {

constexpr Nm kMm = 1'000'000;

struct Rectangle {
  double x, y, wide, deep;
  bool hole = false;
};

Contours region_of(const std::vector<Rectangle>& rectangles) {
  Contours contours;
  for (const auto& [x, y, wide, deep, hole] : rectangles) {
    const auto at = [](double mm) { return static_cast<Nm>(std::lround(mm * kMm)); };
    const Point2 a{at(x), at(y)}, b{at(x + wide), at(y)}, c{at(x + wide), at(y + deep)}, d{at(x), at(y + deep)};
    for (const Point2 p : hole ? std::vector{a, d, c, b} : std::vector{a, b, c, d}) contours.point.push_back(p);
    contours.close();
  }
  return contours;
}

Contours circle_of(double radius, int sides) {
  Contours contours;
  for (int i = 0; i < sides; ++i) {
    const double turn = 2 * std::numbers::pi * i / sides;
    contours.point.push_back(
        {static_cast<Nm>(std::lround(radius * std::cos(turn))), static_cast<Nm>(std::lround(radius * std::sin(turn)))});
  }
  contours.close();
  return contours;
}

double area_of(const ContoursView& own, const ContoursView& below, std::int64_t reach) {
  RegionBelow scratch;
  const auto region = find_overhangs(own, below, reach, scratch);
  EXPECT_TRUE(region) << region.error().message;
  return region ? square_mm(doubled_area(*region)) : -1;
}

TEST(Overhangs, ABarOnALegHangsOnBothSidesOfTheLeg) {
  const Contours leg = region_of({{15, 0, 10, 10}}), bar = region_of({{0, 0, 40, 10}});
  EXPECT_NEAR(area_of(bar, leg, 50'000), 300, 1e-3);
  EXPECT_NEAR(area_of(bar, leg, 2 * kMm), 300, 1e-3) << "all that the face adds, not what is beyond the reach";
  EXPECT_EQ(area_of(bar, leg, 15 * kMm + 100), 0);
  EXPECT_EQ(area_of(leg, bar, 50'000), 0);
  EXPECT_EQ(area_of(bar, bar, 0), 0);
}

TEST(Overhangs, WhatDoesNotMeetTheLayerBelowHangsAsAWhole) {
  const Contours below = region_of({{0, 0, 10, 10}});
  EXPECT_NEAR(area_of(region_of({{0, 0, 10, 10}, {10.01, 0, 5, 10}}), below, 20'000), 50, 1e-3);
  EXPECT_NEAR(area_of(region_of({{10, 0, 0.01, 10}}), below, 20'000), 0.1, 1e-6) << "touches, within the reach";
  EXPECT_NEAR(area_of(below, Contours(), 20'000), 100, 1e-3);
}

TEST(Overhangs, LidsOfHolesHang) {
  const Contours ring = region_of({{0, 0, 20, 20}, {5, 5, 10, 10, true}});
  EXPECT_NEAR(area_of(region_of({{0, 0, 20, 20}}), ring, 200'000), 100, 1e-3);
  EXPECT_EQ(area_of(region_of({{0, 0, 20, 20}}), ring, 5 * kMm + 100), 0);
  // A post in the hole carries what is near it: a lid of 100 mm2 less the post hangs.
  const Contours post = region_of({{0, 0, 20, 20}, {5, 5, 10, 10, true}, {8, 8, 4, 4}});
  EXPECT_NEAR(area_of(region_of({{0, 0, 20, 20}}), post, 200'000), 84, 1e-3);
  EXPECT_EQ(area_of(region_of({{0, 0, 20, 20}}), post, 15 * kMm / 10 + 100), 0);
  // The same hole, and a post that becomes wider in it.
  EXPECT_NEAR(area_of(region_of({{0, 0, 20, 20}, {5, 5, 10, 10, true}, {7, 7, 6, 6}}), post, 200'000), 20, 1e-3);
  EXPECT_EQ(area_of(post, post, 0), 0);
}

TEST(Overhangs, FacesHangAtTheAngleAndNotAtSmallerOnes) {
  for (const double radius : {3e3, 1e5, 5e6}) {
    const Contours below = circle_of(radius, 64);
    for (const double reach : {1000.0, 50'000.0}) {
      const auto grown = [&](double share) { return circle_of(radius + share * reach / std::cos(std::numbers::pi / 64), 64); };
      EXPECT_EQ(area_of(grown(0.9827), below, static_cast<std::int64_t>(reach)), 0) << radius << " " << reach;
      const Contours wider = grown(1.0176);
      EXPECT_NEAR(area_of(wider, below, static_cast<std::int64_t>(reach)), square_mm(doubled_area(wider) - doubled_area(below)),
                  1e-4 * square_mm(doubled_area(wider)))
          << radius << " " << reach;
    }
  }
}

TEST(Overhangs, EdgesBetweenSteepFacesDoNotHang) {
  // A square that grows by 0.97 of the reach on all sides: its corners move by 1.37 of it.
  EXPECT_EQ(area_of(region_of({{-0.097, -0.097, 10.194, 10.194}}), region_of({{0, 0, 10, 10}}), 100'000), 0);
  EXPECT_NEAR(area_of(region_of({{-0.103, -0.103, 10.206, 10.206}}), region_of({{0, 0, 10, 10}}), 100'000),
              10.206 * 10.206 - 100, 1e-3);
}

TEST(Overhangs, ReachIsThatOfTheAngle) {
  EXPECT_EQ(overhang_reach(200'000, 45), 200'000);
  EXPECT_EQ(overhang_reach(200'000, 0), 0);
  EXPECT_EQ(overhang_reach(100'000, 60), 173'205);
}

TEST(Overhangs, LocationsJoinAreasOfLayersThatRestOnEachOther) {
  OverhangTally tally;
  for (std::uint32_t i = 0; i < 4; ++i) {
    const auto x = static_cast<Nm>(i * 100'000);
    const Contours region = region_of({{x * 1e-6, 0, 1, 2}});
    tally.add({i, static_cast<Nm>(i * 200'000), 200'000}, i == 2 ? LayerOverhang() : measure_overhang(region));
  }
  EXPECT_NEAR(tally.area_mm2(), 6, 1e-9);
  EXPECT_EQ(tally.layers(), 3u);
  const auto locations = tally.largest();
  ASSERT_EQ(locations.size(), 2u);
  EXPECT_NEAR(locations[0].area_mm2, 4, 1e-9);
  EXPECT_NEAR(locations[0].x_mm, 0.5, 1e-9);
  EXPECT_NEAR(locations[0].y_mm, 1, 1e-9);
  EXPECT_NEAR(locations[0].z_mm, 0.1, 1e-9);
  EXPECT_NEAR(locations[1].z_mm, 0.7, 1e-9);
  std::vector<Warning> warnings;
  tally.warn(45, warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_TRUE(warnings[0].text.starts_with("6.00 mm2 in 3 layers from 0 to 3")) << warnings[0].text;
  EXPECT_EQ(warnings[0].layer, 0u);
}

TEST(Overhangs, PointsOfPiecesAreInThem) {
  const LayerOverhang facts = measure_overhang(region_of({{0, 0, 10, 10}, {1, 1, 8, 8, true}, {20, 0, 1, 1}}));
  EXPECT_NEAR(facts.area_mm2, 37, 1e-9);
  ASSERT_EQ(facts.spots.size(), 2u);
  EXPECT_NEAR(facts.spots[0].area_mm2, 36, 1e-9);
  EXPECT_EQ(facts.spots[0].at, (Point2{500'000, 5 * kMm}));
  EXPECT_EQ(facts.spots[1].at, (Point2{20'500'000, 500'000}));
}

}  // namespace
}  // namespace lamina::checks
