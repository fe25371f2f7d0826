// tests/arrange/test_silhouette.cpp: shadows of parts, and shapes grown by a gap.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "stages/arrange/silhouette.h"

namespace lamina::test {
namespace {

using arrange::BitShape;

Mesh triangle_mesh(std::initializer_list<Triangle> triangles) {
  Mesh mesh;
  for (const Triangle& t : triangles) {
    mesh.triangles.push_back(t);
    for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
  }
  return mesh;
}

const std::vector<Instance> kAtOrigin{{0, {0, 0, 0}}};

TEST(Shadow, HasTheCellsThatATriangleReachesInto) {
  // The lower left half of a square of 10 mm, 3 mm above the origin of the file and turned in quarter turns.
  const std::vector<Mesh> meshes{triangle_mesh({{{0, 0, 3'000'000}, {10'000'000, 0, 3'000'000}, {0, 10'000'000, 4'000'000}}})};
  const auto shadow = arrange::shadow_of(meshes, kAtOrigin, 0, 1'000'000);
  EXPECT_EQ(shadow.width, 10'000'000);
  EXPECT_EQ(shadow.height, 1'000'000);
  EXPECT_EQ(shadow.shape.width, 11u) << "the edge at 10 mm touches an eleventh cell";
  for (std::uint32_t y = 0; y < 10; ++y) {
    for (std::uint32_t x = 0; x < 10; ++x)
      EXPECT_EQ(shadow.shape.at(x, y), x + y <= 10) << x << " " << y << ": the corner of a cell on the edge counts";
  }
  const auto turned = arrange::shadow_of(meshes, kAtOrigin, kTurn / 4, 1'000'000);
  EXPECT_TRUE(turned.shape.at(9, 0));
  EXPECT_TRUE(turned.shape.at(9, 9)) << "(x, y) becomes (10 - y, x)";
  EXPECT_FALSE(turned.shape.at(0, 9));
}

// Points of random triangles, found by weights, are in set cells, and few cells are set that have none.
TEST(Shadow, ContainsEveryPointInAnyTurn) {
  std::mt19937 random(7);
  std::uniform_int_distribution<Nm> coordinate(-20'000'000, 20'000'000);
  std::uniform_real_distribution<double> share(0, 1);
  for (int round = 0; round < 20; ++round) {
    const auto corner = [&] { return Point3{coordinate(random), coordinate(random), 0}; };
    const Triangle t{corner(), corner(), corner()};
    const std::vector<Mesh> meshes{triangle_mesh({t})};
    const double angle = share(random) * 2 * M_PI;
    const auto shadow = arrange::shadow_of(meshes, kAtOrigin, std::llround(angle * 180e6 / M_PI) % kTurn, 700'000);
    const auto turned = [&](const Point3& p) {
      return std::pair(p.x * std::cos(angle) - p.y * std::sin(angle), p.x * std::sin(angle) + p.y * std::cos(angle));
    };
    const auto a = turned(t.a), b = turned(t.b), c = turned(t.c);
    const double low_x = std::min({a.first, b.first, c.first}), low_y = std::min({a.second, b.second, c.second});
    for (int i = 0; i < 200; ++i) {
      double u = share(random), v = share(random);
      if (u + v > 1) u = 1 - u, v = 1 - v;
      const double x = a.first + u * (b.first - a.first) + v * (c.first - a.first) - low_x;
      const double y = a.second + u * (b.second - a.second) + v * (c.second - a.second) - low_y;
      EXPECT_TRUE(shadow.shape.at(static_cast<std::uint32_t>(x / 700'000), static_cast<std::uint32_t>(y / 700'000)));
    }
    const double area =
        std::abs((b.first - a.first) * (c.second - a.second) - (b.second - a.second) * (c.first - a.first)) * 5e-13;
    const double around =
        (std::hypot(b.first - a.first, b.second - a.second) + std::hypot(c.first - b.first, c.second - b.second) +
         std::hypot(a.first - c.first, a.second - c.second)) *
        1e-6;
    EXPECT_LE(shadow.area_mm2, area + 1.5 * 0.7 * around + 4 * 0.49);
  }
}

// By comparing all cells with all: grown are those whose squares are nearer than the gap.
TEST(GrownShape, HasAllCellsNearerThanTheGap) {
  std::mt19937 random(3);
  for (const std::int64_t gap : {0, 1, 250, 1000, 1001, 2500, 7300}) {
    BitShape shape(70, 9);
    const auto below = [&](std::uint32_t limit) { return static_cast<std::uint32_t>(random() % limit); };
    for (int i = 0; i < 12; ++i) {
      const std::uint32_t y = below(9), x = below(70);
      shape.set(y, x, std::min(70u, x + 1 + below(5)));
    }
    const auto grown = arrange::grown_shape(shape, gap, 1000);
    for (std::uint32_t y = 0; y < grown.shape.depth; ++y) {
      for (std::uint32_t x = 0; x < grown.shape.width; ++x) {
        bool near = false;
        for (std::uint32_t v = 0; v < shape.depth; ++v) {
          for (std::uint32_t u = 0; u < shape.width; ++u) {
            if (!shape.at(u, v)) continue;
            const double dx = std::abs(static_cast<double>(std::int64_t{x} - grown.reach - u)),
                         dy = std::abs(static_cast<double>(std::int64_t{y} - grown.reach - v));
            near = near || (dx == 0 && dy == 0) ||
                   std::hypot(std::max(dx - 1, 0.0), std::max(dy - 1, 0.0)) * 1000 < static_cast<double>(gap);
          }
        }
        EXPECT_TRUE(!near || grown.shape.at(x, y)) << gap << ": " << x << " " << y;
      }
    }
  }
}

}  // namespace
}  // namespace lamina::test
