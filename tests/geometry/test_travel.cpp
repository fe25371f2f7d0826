// Travels inside of contours: the grid of edges against all edges, and the routes that it finds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "stages/geometry/travel/edge_grid.h"
#include "stages/geometry/travel/inside_route.h"

namespace lamina::travel {
namespace {

void add_star(std::mt19937& random, Point2 centre, double radius, double noise, int corners, bool hole, Contours& out) {
  std::uniform_real_distribution<double> share(1 - noise, 1);
  const std::size_t first = out.point.size();
  for (int i = 0; i < corners; ++i) {
    const double angle = 2 * std::numbers::pi * i / corners, r = radius * share(random);
    out.point.push_back({static_cast<Nm>(centre.x + r * std::cos(angle)), static_cast<Nm>(centre.y + r * std::sin(angle))});
  }
  if (hole) std::reverse(out.point.begin() + static_cast<std::ptrdiff_t>(first), out.point.end());
  out.close();
}

/// Two islands of 40 mm with holes and an island in one of them.
Contours random_region(unsigned seed, int corners) {
  std::mt19937 random(seed);
  Contours region;
  for (const Nm x : {0, 90'000'000}) {
    add_star(random, {x, 0}, 40e6, 0.3, corners, false, region);
    add_star(random, {x + 10'000'000, 5'000'000}, 10e6, 0.4, corners, true, region);
    add_star(random, {x - 12'000'000, -8'000'000}, 8e6, 0.2, 7, true, region);
  }
  add_star(random, {10'000'000, 5'000'000}, 4e6, 0.1, 9, false, region);
  return region;
}

int turn(Point2 a, Point2 b, Point2 c) {
  const __int128 area = static_cast<__int128>(std::int64_t{b.x} - a.x) * (std::int64_t{c.y} - a.y) -
                        static_cast<__int128>(std::int64_t{b.y} - a.y) * (std::int64_t{c.x} - a.x);
  return area > 0 ? 1 : area < 0 ? -1 : 0;
}

template <class Visit>
void for_each_edge(const Contours& region, const Visit& visit) {
  for (std::uint32_t c = 0; c < region.size(); ++c) {
    for (std::size_t i = 0; i < region[c].size(); ++i) visit(region[c][i], region[c][(i + 1) % region[c].size()]);
  }
}

/// Properly crossed edges; random lines touch none.
int crossed_edges(const Contours& region, Point2 a, Point2 b) {
  int count = 0;
  for_each_edge(region,
                [&](Point2 p, Point2 q) { count += turn(a, b, p) * turn(a, b, q) < 0 && turn(p, q, a) * turn(p, q, b) < 0; });
  return count;
}

bool is_inside(const Contours& region, Point2 p) {
  return crossed_edges(region, {-2'000'000'000, 1'234'567'891}, p) % 2 == 1;  // from far outside
}

Point2 random_point(std::mt19937& random) {
  std::uniform_int_distribution<Nm> x(-50'000'000, 140'000'000), y(-50'000'000, 50'000'000);
  const Nm first = x(random);
  return {first, y(random)};
}

TEST(EdgeGrid, FindsTheEdgesAndTheRegionThatAllEdgesGive) {
  for (const int corners : {5, 40, 300}) {
    const Contours region = random_region(static_cast<unsigned>(corners), corners);
    const EdgeGrid grid(region);
    EXPECT_LE(grid.bytes(), EdgeGrid::kBytesOfPoint * region.point.size() + EdgeGrid::kBytesOfGrid);
    std::mt19937 random(9);
    std::uniform_int_distribution<Nm> near(-300'000, 300'000);
    Buffer<EdgeGrid::EdgeCrossing> found;
    for (int i = 0; i < 600; ++i) {
      const Point2 a = random_point(random);
      const Point2 b = i % 2 ? random_point(random) : Point2{a.x + near(random), a.y + near(random)};
      const int count = crossed_edges(region, a, b);
      ASSERT_EQ(grid.crosses(a, b), count > 0);
      ASSERT_EQ(grid.contains(a), is_inside(region, a)) << a.x << ' ' << a.y;
      grid.crossings(a, b, found);
      ASSERT_EQ(found.size(), static_cast<std::size_t>(count));
      double before = 0;
      for (const EdgeGrid::EdgeCrossing& crossing : found) {
        ASSERT_GE(crossing.at, before);
        ASSERT_LE(crossing.at, 1);
        before = crossing.at;
      }
    }
  }
}

TEST(EdgeGrid, HasLinearMemoryForLongThinAndEmptyContours) {
  Contours region;
  for (Nm i = 0; i < 2000; ++i) {  // slabs of 200 mm, 50 um apart
    for (const Point2 p :
         {Point2{0, i * 100'000}, {200'000'000, i * 100'000}, {200'000'000, i * 100'000 + 50'000}, {0, i * 100'000 + 50'000}})
      region.point.push_back(p);
    region.close();
  }
  Contours line;
  line.point = {{-1'000'000'000, 0}, {1'000'000'000, 0}, {0, 1}};
  line.close();
  for (const Contours* contours : {&region, &line}) {
    const EdgeGrid grid(*contours);
    EXPECT_LE(grid.bytes(), EdgeGrid::kBytesOfPoint * contours->point.size() + EdgeGrid::kBytesOfGrid);
  }
  EXPECT_TRUE(EdgeGrid(region).contains({1'000'000, 25'000}));
  EXPECT_FALSE(EdgeGrid(region).crosses({1'000'000, 25'000}, {199'000'000, 25'000}));
  EXPECT_TRUE(EdgeGrid(region).crosses({1'000'000, 25'000}, {1'000'000, 75'000}));
  const Contours none;
  const EdgeGrid empty(none);
  EXPECT_FALSE(empty.crosses({0, 0}, {1, 1}) || empty.contains({0, 0}));
}

TEST(EdgeGrid, CountsALineThatTouchesAnEdgeAsCrossing) {
  Contours square;
  square.point = {{0, 0}, {1'000'000, 0}, {1'000'000, 1'000'000}, {0, 1'000'000}};
  square.close();
  const EdgeGrid grid(square);
  EXPECT_TRUE(grid.crosses({500'000, 500'000}, {500'000, 0}));
  EXPECT_FALSE(grid.crosses({500'000, 500'000}, {500'000, 1}));
  EXPECT_TRUE(grid.crosses({-1, 0}, {0, 0}));
  EXPECT_TRUE(grid.crosses({100, 0}, {200, 0})) << "along an edge";
}

TEST(InsideRoute, NeverCrossesAContourAndIsNoLongerThanItsLimit) {
  int straight = 0, around = 0, none = 0;
  for (const int corners : {6, 30, 200}) {
    const Contours region = random_region(static_cast<unsigned>(corners) + 1, corners);
    const EdgeGrid grid(region);
    InsideRoute route(grid, 200'000, 60e6);
    std::mt19937 random(3);
    for (int i = 0; i < 2000; ++i) {
      const Point2 a = random_point(random), b = random_point(random);
      const auto& points = route.find(a, b);
      if (!is_inside(region, a) || !is_inside(region, b)) {
        ASSERT_TRUE(points.empty());
        continue;
      }
      if (crossed_edges(region, a, b) == 0) {
        ASSERT_EQ(points.size(), 1u);
        ++straight;
      }
      if (points.empty()) {
        ++none;
        continue;
      }
      around += points.size() > 1;
      ASSERT_EQ(points.back(), b);
      double way = 0;
      Point2 at = a;
      for (const Point2 p : points) {
        ASSERT_EQ(crossed_edges(region, at, p), 0);
        ASSERT_TRUE(is_inside(region, p));
        way += length_nm(at, p);
        at = p;
      }
      ASSERT_LE(way, length_nm(a, b) + 60e6 + 1);
    }
  }
  EXPECT_GT(straight, 100);
  EXPECT_GT(around, 100);
  EXPECT_GT(none, 200) << "between islands";
}

TEST(InsideRoute, GoesAroundASlotByItsShorterSide) {
  Contours frame;  // 30 x 20 mm with a slot of 10 x 4 mm, nearer to the front
  frame.point = {{0, 0}, {30'000'000, 0}, {30'000'000, 20'000'000}, {0, 20'000'000}};
  frame.close();
  for (const Point2 p :
       {Point2{10'000'000, 4'000'000}, {10'000'000, 14'000'000}, {14'000'000, 14'000'000}, {14'000'000, 4'000'000}})
    frame.point.push_back(p);
  frame.close();
  const EdgeGrid grid(frame);
  InsideRoute route(grid, 200'000, 20e6);
  const Point2 a{8'000'000, 8'000'000}, b{16'000'000, 8'000'000};
  const auto points = route.find(a, b);
  ASSERT_EQ(points.size(), 3u);
  EXPECT_EQ(points[0], (Point2{9'800'000, 3'800'000}));
  EXPECT_EQ(points[1], (Point2{14'200'000, 3'800'000}));
  InsideRoute shorter(grid, 200'000, 5e6);  // the way is 13.5 mm, the line 8 mm
  EXPECT_TRUE(shorter.find(a, b).empty());
  InsideRoute long_enough(grid, 200'000, 6e6);
  EXPECT_EQ(long_enough.find(a, b).size(), 3u);
  InsideRoute off(grid, 200'000, 0);
  EXPECT_TRUE(off.find(a, b).empty());
  EXPECT_EQ(off.find(a, {a.x, 18'000'000}).size(), 1u);
}

}  // namespace
}  // namespace lamina::travel
