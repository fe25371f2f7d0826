// tests/infill/test_raft.cpp: the layers under the parts.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/geometry/bead_section.h"
#include "stages/infill/raft.h"
#include "tests/infill/outlines.h"

namespace lamina::test {
namespace {

constexpr std::array<std::int64_t, 2> kRaftBed{200 * kMm, 200 * kMm};

double raft_volume(const Toolpaths& paths, double height_mm) {
  double sum = 0;
  const ToolpathsView view = paths.view();
  for (std::uint32_t p = 0; p < view.size(); ++p) {
    for (std::uint32_t i = view.offset[p]; i + 1 < view.offset[p + 1]; ++i) {
      const Point2 a = view.point[i], b = view.point[i + 1];
      const double length = std::hypot(mm(std::int64_t{b.x} - a.x), mm(std::int64_t{b.y} - a.y));
      sum += length * bead_area(mm(view.width[i]), height_mm, BeadShape::kStadium);
    }
  }
  return sum;
}

TEST(Raft, CoversHolesAndAMargin) {
  const Contours ring = contours_of({{{50, 50}, {70, 50}, {70, 70}, {50, 70}}, {{55, 55}, {55, 65}, {65, 65}, {65, 55}}});
  const auto region = infill::raft_region(ring, 3 * kMm, kRaftBed);
  ASSERT_TRUE(region.ok());
  ASSERT_EQ(region->size(), 1u);
  EXPECT_NEAR(square_mm(doubled_area(*region)), 26 * 26, 1e-6);
  // Two parts 4 mm from each other have one raft; at the edge of the bed it ends.
  const Contours two = contours_of({{{1, 1}, {21, 1}, {21, 21}, {1, 21}}, {{25, 1}, {45, 1}, {45, 21}, {25, 21}}});
  const auto joined = infill::raft_region(two, 3 * kMm, kRaftBed);
  ASSERT_TRUE(joined.ok());
  ASSERT_EQ(joined->size(), 1u);
  EXPECT_NEAR(square_mm(doubled_area(*joined)), 48 * 24, 1e-6);
}

// 0.357 mm of a wall, and 90 %, 50 % and all of what is inside it.
TEST(Raft, HasADensityByLayer) {
  const Contours square = contours_of({{{50, 50}, {70, 50}, {70, 70}, {50, 70}}});
  const double densities[] = {0.9, 0.5, 1};
  for (std::uint32_t i = 0; i < 3; ++i) {
    Toolpaths paths;
    const Layer layer{i, static_cast<Nm>(i * 200'000), 200'000};
    ASSERT_TRUE(infill::append_raft(square, layer, 3, {}, paths).ok());
    const double wall = 4 * 19.6 * bead_area(0.4, 0.2, BeadShape::kStadium), inside = std::pow(20 - 2 * 0.4 + 0.0429, 2) * 0.2;
    EXPECT_NEAR(raft_volume(paths, 0.2), wall + densities[i] * inside, 0.015 * inside) << i;
  }
}

}  // namespace
}  // namespace lamina::test
