// Copies that overlap many times: their union is known, and the work for it grows with their number.
#include <gtest/gtest.h>

#include <vector>

#include "stages/geometry/boxes.h"
#include "stages/slice/deep.h"
#include "stages/slice/slice.h"
#include "tests/raster/shapes.h"

namespace lamina::slice {
namespace {

constexpr Nm kSide = 10'000'000;

/// Cubes of one mesh, each moved by `step` along the diagonal of the bed.
std::vector<Instance> stairs(std::uint32_t count, Nm step) {
  std::vector<Instance> instances;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Nm by = static_cast<Nm>(i) * step;
    instances.push_back({0, {by, by, 0}});
  }
  return instances;
}

std::vector<Box> boxes_of(const Mesh& mesh, std::span<const Instance> instances) {
  std::vector<Box> boxes;
  for (const Instance& instance : instances) {
    const auto moved = [&](const Point3& p) { return Point3{p.x + instance.offset.x, p.y + instance.offset.y, p.z}; };
    boxes.push_back({moved(mesh.bounds.lo), moved(mesh.bounds.hi)});
  }
  return boxes;
}

Mesh cube() { return test::make_mesh(test::box({0, 0, 0}, {kSide, kSide, kSide})); }

__int128 area_of(const Mesh& mesh, std::span<const Instance> instances, FillRule rule) {
  const std::vector<std::uint32_t> body(instances.size(), 0);
  const std::vector<Nm> planes{kSide / 2};
  SliceOptions options;
  options.fill_rule = rule;
  const auto slicer = Slicer::build(std::span(&mesh, 1), instances, body, planes, options);
  EXPECT_TRUE(slicer.ok());
  SectionScratch scratch;
  LayerContours contours;
  const auto report = slicer->layer(0, scratch, contours);
  EXPECT_TRUE(report.ok()) << (report ? "" : report.error().message);
  return doubled_area(contours.contours) / 2;
}

TEST(Deep, BoxesAtOnePositionAreOneGroupAfterFewComparisonsEach) {
  for (const Nm step : {0, 1000}) {
    const std::vector<Instance> instances = stairs(5000, step);
    std::uint64_t compared = 0;
    const std::vector<std::uint32_t> group = group_touching(boxes_of(cube(), instances), &compared);
    EXPECT_EQ(group, std::vector<std::uint32_t>(instances.size(), 0)) << step;
    EXPECT_LE(compared, 20 * instances.size()) << step;
  }
}

TEST(Deep, TheUnionOfManyCopiesHasItsKnownAreaByEveryRule) {
  const Mesh mesh = cube();
  constexpr std::int64_t kSquare = std::int64_t{kSide} * kSide;
  for (const std::uint32_t count : {150u, 151u, 2000u}) {
    for (const Nm step : {0, 1000}) {
      const std::vector<Instance> instances = stairs(count, step);
      EXPECT_TRUE(overlaps_deeply(boxes_of(mesh, instances)));
      const std::int64_t widened = kSquare + std::int64_t{count - 1} * (2 * std::int64_t{kSide} - step) * step;
      EXPECT_TRUE(area_of(mesh, instances, FillRule::kNonzero) == widened) << count << " by " << step;
      EXPECT_TRUE(area_of(mesh, instances, FillRule::kPositive) == widened) << count << " by " << step;
    }
    EXPECT_TRUE(area_of(mesh, stairs(count, 0), FillRule::kEvenOdd) == (count % 2 == 1 ? kSquare : 0)) << count;
  }
}

TEST(Deep, MoreThanSixteenOverlapsForEachBoxAreDeep) {
  EXPECT_FALSE(overlaps_deeply(boxes_of(cube(), stairs(33, 1000))));  // 33 x 32 / 2 pairs
  EXPECT_TRUE(overlaps_deeply(boxes_of(cube(), stairs(34, 1000))));
}

TEST(Deep, BooleanOperationsHaveFewPointsAndPairsForEachSet) {
  for (const std::uint32_t count : {500u, 1000u}) {
    std::vector<Contours> sets(count);
    for (std::uint32_t i = 0; i < count; ++i) {
      const Nm by = static_cast<Nm>(i) * 1000;
      sets[i].point = {{by, by}, {by + kSide, by}, {by + kSide, by + kSide}, {by, by + kSide}};
      sets[i].close();
    }
    CombineWork work;
    ASSERT_TRUE(combine_in_groups(std::move(sets), FillRule::kNonzero, &work).ok());
    EXPECT_LE(work.points, 20 * count);  // one after the other: count^2
    EXPECT_LE(work.pairs, 5 * count);    // all at once: count^2 / 2
  }
}

TEST(Deep, SurplusOfCopiesIsTheUnionLessTheSum) {
  const Mesh mesh = cube();
  const auto areas = surplus_areas(std::span(&mesh, 1), stairs(1000, 1000), std::vector<Nm>{kSide / 2});
  ASSERT_TRUE(areas.ok());
  EXPECT_NEAR(areas->front(), 100 + 999 * 19.999e-3 - 1000 * 100, 1e-6);
  std::vector<Instance> instances = stairs(1000, 1000);
  for (std::size_t i = 0; i < 300; ++i) instances.push_back(instances[i % 3]);
  const auto repeated = surplus_areas(std::span(&mesh, 1), instances, std::vector<Nm>{kSide / 2});
  ASSERT_TRUE(repeated.ok());
  EXPECT_NEAR(repeated->front(), 100 + 999 * 19.999e-3 - 1300 * 100, 1e-6);
}

TEST(Deep, CopiesOfAMeshThatIsInsideOutAreRefused) {
  const Mesh mesh = test::make_mesh(test::reversed(test::box({0, 0, 0}, {kSide, kSide, kSide})));
  const auto areas = surplus_areas(std::span(&mesh, 1), stairs(1000, 1000), std::vector<Nm>{kSide / 2});
  ASSERT_FALSE(areas.ok());
  EXPECT_EQ(areas.error().fault, Fault::kInput);
}

}  // namespace
}  // namespace lamina::slice
