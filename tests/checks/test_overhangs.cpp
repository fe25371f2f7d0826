// Overhangs of rectangles, rings and polygons against hand-calculated areas.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "stages/checks/overhang_tally.h"
#include "stages/checks/overhangs.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/nest.h"

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

/// Rectangles and circles, some of them holes, that move from layer to layer.
struct RandomShapes {
  std::mt19937 random;
  std::vector<std::array<double, 4>> shapes;  // x, y, size, 0: solid square, 1: solid circle, 2: square hole, 3: round hole

  double draw(double low, double high) { return std::uniform_real_distribution<>(low, high)(random); }
  Contours region() const {
    Contours solid, holes;
    for (const auto& [x, y, size, kind] : shapes) {
      Contours one = kind == 1 || kind == 3 ? circle_of(size * kMm / 2, 40) : region_of({{-size / 2, -size / 2, size, size}});
      for (Point2& p : one.point) p = {p.x + static_cast<Nm>(x * kMm), p.y + static_cast<Nm>(y * kMm)};
      (kind >= 2 ? holes : solid).append(one);
    }
    Contours region = *subtract_contours(*contour_union(solid, FillRule::kNonzero), *contour_union(holes, FillRule::kNonzero));
    order_by_outer(region);
    return region;
  }
};

/// By the definition, with boolean operations of all contours.
double defined_area(const Contours& own, const Contours& below, std::int64_t reach) {
  const Contours carrying = *offset_contours(below, std::max<std::int64_t>(reach - 4, 4));
  Contours candidates;
  double area = 0;
  for (std::uint32_t begin = 0, end = 0; begin < own.size(); begin = end) {
    end = begin + 1;
    while (end < own.size() && doubled_area(own[end]) < 0) ++end;
    Contours component;
    for (std::uint32_t c = begin; c < end; ++c) {
      component.point.insert(component.point.end(), own[c].begin(), own[c].end());
      component.close();
    }
    if (intersect_contours(component, below)->size() == 0) {
      area += square_mm(doubled_area(component));
    } else if (subtract_contours(component, carrying)->size() > 0) {
      candidates.append(component);
    }
  }
  const Contours far = *subtract_contours(candidates, carrying);
  const Contours near = *intersect_contours(candidates, *offset_contours(far, reach + 8));
  return area + square_mm(doubled_area(*subtract_contours(near, below)));
}

TEST(Overhangs, AreThoseOfTheDefinition) {
  RandomShapes shapes{std::mt19937(7), {}};
  int hanging = 0, carried = 0;
  for (int round = 0; round < 400; ++round) {
    shapes.shapes.clear();
    const int count = 2 + round % 12;
    for (int i = 0; i < count; ++i)
      shapes.shapes.push_back({shapes.draw(0, 20), shapes.draw(0, 20), shapes.draw(0.5, 9), std::floor(shapes.draw(0, 4))});
    const Contours below = shapes.region();
    const double largest = shapes.draw(0, 0.4);
    for (auto& [x, y, size, kind] : shapes.shapes) x += shapes.draw(-largest, largest), size += shapes.draw(-largest, largest);
    const Contours own = shapes.region();
    if (own.size() == 0 || below.size() == 0) continue;
    for (const std::int64_t reach : {20'000, 200'000, 1'000'000}) {
      const double expected = defined_area(own, below, reach);
      EXPECT_NEAR(area_of(own, below, reach), expected, 1e-3) << round << " " << reach;
      (expected > 0 ? hanging : carried) += 1;
    }
  }
  EXPECT_GT(hanging, 300);
  EXPECT_GT(carried, 200);
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
