// tests/cost/test_section_area.cpp: areas of the sections of solids, by formula.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/cost/section_area.h"

namespace lamina::test {
namespace {

using Ring = std::vector<std::array<Nm, 2>>;

/// A frustum between two rings of equally many corners, counter-clockwise; turned inside out on request.
Mesh frustum(const Ring& low, const Ring& high, Nm bottom, Nm top, bool hollow = false) {
  Mesh mesh;
  const auto add = [&](Point3 a, Point3 b, Point3 c) {
    if (hollow) std::swap(b, c);
    mesh.triangles.push_back({a, b, c});
    for (const Point3& p : {a, b, c}) mesh.bounds.add(p);
  };
  const auto down = [&](std::size_t i) { return Point3{low[i % low.size()][0], low[i % low.size()][1], bottom}; };
  const auto up = [&](std::size_t i) { return Point3{high[i % high.size()][0], high[i % high.size()][1], top}; };
  for (std::size_t i = 0; i < low.size(); ++i) {
    add(down(i), down(i + 1), up(i + 1));
    add(down(i), up(i + 1), up(i));
    add(down(0), down(i + 1), down(i));
    add(up(0), up(i), up(i + 1));
  }
  return mesh;
}

Ring square(Nm from, Nm to) { return {{from, from}, {to, from}, {to, to}, {from, to}}; }

TEST(SectionAreas, AreThoseOfAFrustumWithACavity) {
  // 20 mm wide at the bottom, 10 mm at the top, 8 mm high; a box of 4 mm is empty from 2 to 6 mm.
  const std::vector<Mesh> meshes{
      frustum(square(0, 20'000'000), square(5'000'000, 15'000'000), 0, 8'000'000),
      frustum(square(8'000'000, 12'000'000), square(8'000'000, 12'000'000), 2'000'000, 6'000'000, true)};
  const std::vector<Instance> instances{{0, {70'000'000, -3'000'000, 1'000'000}}, {1, {70'000'000, -3'000'000, 1'000'000}}};
  const std::vector<double> areas = cost::section_areas(meshes, instances, 80);
  ASSERT_EQ(areas.size(), 80u);
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const double z = (static_cast<double>(i) + 0.5) * 0.1, side = 20 - 10 * z / 8;
    EXPECT_NEAR(areas[i], side * side - (z > 2 && z < 6 ? 16 : 0), 1e-6) << z;
  }
}

TEST(SectionAreas, OfNothingAreZero) { EXPECT_EQ(cost::section_areas({}, {}, 3), (std::vector<double>{0, 0, 0})); }

}  // namespace
}  // namespace lamina::test
