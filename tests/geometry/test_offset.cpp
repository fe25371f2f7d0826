// Mitered offsets against those of Clipper's own offset, which makes and resolves a loop at every corner.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <polyclipping/clipper.hpp>
#include <random>
#include <span>
#include <vector>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/nest.h"

namespace lamina {
namespace {

namespace clip = ClipperLib;

/// A closed curve around a centre whose radius and step change at random: corners of all kinds, edges from 1 nm up.
void add_curve(std::mt19937& random, Point2 centre, double radius, double noise, int corners, bool hole, Contours& out) {
  const auto between = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  std::vector<Point2> points;
  double angle = 0;
  while (angle < 2 * std::numbers::pi - 1e-3) {
    const double r = radius * between(1 - noise, 1 + noise);
    points.push_back({static_cast<Nm>(centre.x + std::lround(r * std::cos(angle))),
                      static_cast<Nm>(centre.y + std::lround(r * std::sin(angle)))});
    angle += 2 * std::numbers::pi / corners * std::pow(10, between(-2, 0.5));
  }
  if (hole) std::ranges::reverse(points);
  for (const Point2 p : points) {
    if (out.point.size() == out.offset.back() || p != out.point.back()) out.point.push_back(p);
  }
  out.close();
}

clip::Paths paths_of(const ContoursView& contours) {
  clip::Paths paths(contours.size());
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    for (const Point2 p : contours[c]) paths[c].emplace_back(p.x, p.y);
  }
  return paths;
}

TEST(OffsetContours, RegionIsThatOfClippersOffsetToWithinItsRounding) {
  std::mt19937 random(11);
  std::size_t pieces = 0;
  for (int round = 0; round < 300; ++round) {
    Contours raw;
    const double noise = round % 3 == 0 ? 0.0 : round % 3 == 1 ? 0.02 : 0.3;
    add_curve(random, {5'000'000, -3'000'000}, 4'000'000, noise, 10 + round % 200, false, raw);
    if (round % 2 == 0) add_curve(random, {5'300'000, -3'200'000}, 1'500'000, noise, 8 + round % 90, true, raw);
    const auto contours = contour_union(raw, FillRule::kPositive);
    ASSERT_TRUE(contours.ok());
    for (const std::int64_t distance : {-150'000, -450'000, -1'300'000, 200'000, 900'000}) {
      const auto own = offset_contours(*contours, distance);
      ASSERT_TRUE(own.ok());
      pieces += own->size();
      clip::ClipperOffset offsetter(2.0, 1000);
      offsetter.AddPaths(paths_of(*contours), clip::jtMiter, clip::etClosedPolygon);
      clip::Paths expected, rest;
      offsetter.Execute(expected, static_cast<double>(distance));
      if (own->size() == 0 && expected.empty()) continue;
      clip::Clipper difference;
      difference.AddPaths(paths_of(*own), clip::ptSubject, true);
      difference.AddPaths(expected, clip::ptClip, true);
      ASSERT_TRUE(difference.Execute(clip::ctXor, rest, clip::pftNonZero, clip::pftNonZero));
      double area = 0, length = 1000;
      for (const clip::Path& path : rest) area += clip::Area(path);
      for (const clip::Path& path : expected) {
        for (std::size_t i = 0; i < path.size(); ++i) {
          const auto &a = path[i], &b = path[(i + 1) % path.size()];
          length += std::hypot(static_cast<double>(b.X - a.X), static_cast<double>(b.Y - a.Y));
        }
      }
      // Two nanometres along the edge, and ten where edges of a few nanometres meet at odd angles.
      EXPECT_LT(area, 2 * length + 1e7) << "round " << round << " distance " << distance;
    }
  }
  EXPECT_GT(pieces, 1500);
}

/// Squares in one another around a point, of the given half width, mm, alternating outer contours and holes.
Contours squares(std::initializer_list<int> halves) {
  Contours out;
  bool hole = false;
  for (const int half : halves) {
    const Nm a = half * 1'000'000;
    const Point2 corner[4] = {{-a, -a}, {a, -a}, {a, a}, {-a, a}};
    for (int k = 0; k < 4; ++k) out.point.push_back(corner[hole ? 3 - k : k]);
    out.close();
    hole = !hole;
  }
  return out;
}

TEST(OffsetContours, IslandsInHolesShrinkByThemselvesAndGrowTogether) {
  const Contours nested = squares({12, 9, 6, 3});
  struct Case {
    std::int64_t distance;
    double area_mm2;
    std::uint32_t contours;
  };
  for (const auto& [distance, area, contours] : {Case{-500'000, 23 * 23 - 19 * 19 + 11 * 11 - 7 * 7, 4},
                                                 {500'000, 25 * 25 - 17 * 17 + 13 * 13 - 5 * 5, 4},
                                                 {2'000'000, 28 * 28 - 2 * 2, 2},  // the island meets what is around it
                                                 {4'000'000, 32 * 32, 1},
                                                 {-1'500'000, 0, 0},
                                                 {-2'000'000, 0, 0}}) {
    const auto moved = offset_contours(nested, distance);
    ASSERT_TRUE(moved.ok());
    EXPECT_EQ(moved->size(), contours) << distance;
    EXPECT_DOUBLE_EQ(square_mm(doubled_area(*moved)), area) << distance;
    for (std::uint32_t c = 0; c < moved->size(); ++c) EXPECT_EQ(doubled_area((*moved)[c]) > 0, c % 2 == 0) << distance;
  }
}

/// A box from (x0, y0) to (x1, y1), mm; turned round, a hole.
struct BoxMm {
  int x0, y0, x1, y1;
  bool hole = false;
};

Contours boxes(std::span<const BoxMm> all) {
  constexpr Nm kMm = 1'000'000;
  Contours out;
  for (const BoxMm& b : all) {
    const Point2 corner[4] = {
        {b.x0 * kMm, b.y0 * kMm}, {b.x1 * kMm, b.y0 * kMm}, {b.x1 * kMm, b.y1 * kMm}, {b.x0 * kMm, b.y1 * kMm}};
    for (int k = 0; k < 4; ++k) out.point.push_back(corner[b.hole ? 3 - k : k]);
    out.close();
  }
  return out;
}

double clippers_area_mm2(const Contours& contours, double distance) {
  clip::ClipperOffset offsetter(2.0, 1000);
  offsetter.AddPaths(paths_of(contours), clip::jtMiter, clip::etClosedPolygon);
  clip::Paths expected;
  offsetter.Execute(expected, distance);
  double area = 0;
  for (const clip::Path& path : expected) area += clip::Area(path);
  return area * 1e-12;
}

// Where boxes share edges, boolean operations leave spikes and put holes after other outer contours than theirs.
TEST(OffsetContours, HolesCountAnywhereInTheList) {
  const std::vector<std::vector<BoxMm>> known = {
      {{0, 6, 1, 12}, {6, 1, 8, 6}, {1, 2, 7, 8}, {3, 3, 5, 7, true}, {5, 1, 9, 6, true}},
      {{2, 5, 4, 8}, {2, 5, 6, 8}, {3, 5, 5, 9}, {1, 4, 3, 5}},
      {{3, 1, 8, 7}, {5, 4, 11, 8}, {7, 4, 10, 8}},
  };
  std::mt19937 random(5);
  const auto not_above = [&](int maximum) { return static_cast<int>(random() % static_cast<unsigned>(maximum)); };
  int unordered = 0;
  for (std::size_t round = 0; round < 600; ++round) {
    std::vector<BoxMm> set;
    if (round < known.size()) {
      set = known[round];
    } else {
      for (int n = 3 + not_above(6); n > 0; --n) {
        const int x = not_above(9), y = not_above(9);
        set.push_back({x, y, x + 1 + not_above(6), y + 1 + not_above(6), not_above(3) == 0});
      }
    }
    for (const FillRule rule : {FillRule::kNonzero, FillRule::kPositive, FillRule::kEvenOdd}) {
      const auto merged = contour_union(boxes(set), rule);
      ASSERT_TRUE(merged.ok());
      EXPECT_TRUE(is_ordered_by_outer(*merged)) << "round " << round;
      Contours backwards;  // the last contour first: holes without their outer one before them
      for (std::uint32_t c = merged->size(); c-- > 0;) {
        backwards.point.insert(backwards.point.end(), (*merged)[c].begin(), (*merged)[c].end());
        backwards.close();
      }
      unordered += is_ordered_by_outer(backwards) ? 0 : 1;
      for (const Contours& given : {*merged, backwards}) {
        const auto moved = offset_contours(given, -200'000);
        ASSERT_TRUE(moved.ok());
        EXPECT_NEAR(square_mm(doubled_area(*moved)), clippers_area_mm2(*merged, -200'000), 1e-3) << "round " << round;
      }
    }
  }
  EXPECT_GE(unordered, 100);
}

}  // namespace
}  // namespace lamina
