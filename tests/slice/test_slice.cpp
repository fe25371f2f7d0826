// tests/slice/test_slice.cpp: contours of small solids whose every corner is known.
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "stages/data/voxels.h"
#include "stages/geometry/blocks/block_maker.h"
#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/nest.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/slice/slice.h"
#include "tests/raster/shapes.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using slice::Edge;

struct Sliced {
  slice::LayerContours contours;
  slice::SectionReport report;
};

Sliced sliced(const Triangles& triangles, Nm plane, slice::SliceOptions options = {}) {
  const std::vector<Mesh> meshes{make_mesh(triangles)};
  const std::vector<Instance> instances{{0, {0, 0, 0}}};
  const std::vector<std::uint32_t> body{0};
  const std::vector<Nm> planes{plane};
  auto slicer = slice::Slicer::build(meshes, instances, body, planes, options);
  EXPECT_TRUE(slicer.ok());
  slice::SectionScratch scratch;
  Sliced result;
  auto report = slicer->layer(0, scratch, result.contours);
  EXPECT_TRUE(report.ok()) << (report ? "" : report.error().message);
  if (report) result.report = *report;
  return result;
}

Triangles joined(std::initializer_list<Triangles> all) {
  Triangles out;
  for (const Triangles& some : all) out.insert(out.end(), some.begin(), some.end());
  return out;
}

double square(const Sliced& result) { return static_cast<double>(doubled_area(result.contours.contours)) / 2; }

TEST(Cut, CrossingsAreTheNearestNanometreOfTheExactPoint) {
  std::mt19937 random(7);
  std::uniform_int_distribution<Nm> any(0, 2'000'000'000), few(0, 6);
  for (int i = 0; i < 200'000; ++i) {
    auto& pick = i % 2 == 0 ? any : few;
    Edge edge{{pick(random), pick(random), pick(random)}, {pick(random), pick(random), pick(random)}};
    if (edge.low.z == edge.high.z) continue;
    if (edge.low.z > edge.high.z) std::swap(edge.low, edge.high);
    const Nm z = edge.low.z + static_cast<Nm>(std::uniform_int_distribution<Nm>(0, edge.high.z - edge.low.z - 1)(random));
    const Point2 p = slice::crossing(edge, z);
    const __int128 den = std::int64_t{edge.high.z} - edge.low.z, num = std::int64_t{z} - edge.low.z;
    for (const auto& [from, to, got] : {std::tuple{edge.low.x, edge.high.x, p.x}, {edge.low.y, edge.high.y, p.y}}) {
      // |got - exact| <= 1/2, the upper half when it is a tie: -den < 2 (exact - got) den <= den reversed
      const __int128 twice =
          2 * (static_cast<__int128>(got - std::int64_t{from}) * den - static_cast<__int128>(std::int64_t{to} - from) * num);
      ASSERT_TRUE(-den < twice && twice <= den) << "edge " << i;
    }
  }
}

TEST(Cut, PlaneThroughAFlatBottomIsCutAndThroughAFlatTopIsNot) {
  const Triangles cube = box({0, 0, 0}, {1000, 1000, 1000});
  EXPECT_EQ(square(sliced(cube, 0)), 1e6);
  EXPECT_EQ(square(sliced(cube, 899)), 1e6);
  EXPECT_EQ(sliced(cube, 900).contours.contours.size(), 0u);  // a face up to 100 nm above the plane counts as in it
  EXPECT_EQ(sliced(cube, 1000).contours.contours.size(), 0u);
  EXPECT_EQ(square(sliced(cube, -100)), 1e6);
  EXPECT_EQ(sliced(cube, -101).contours.contours.size(), 0u);
}

TEST(Cut, AFaceThatLiesOnBothSidesOfWhatCountsAsInThePlaneIsReported) {
  Triangles cube = box({0, 0, 0}, {2'000'000, 1'000'000, 1'000'000});
  for (Triangle& t : cube) {
    for (Point3* p : {&t.a, &t.b, &t.c}) p->z += p->z > 0 && p->x > 0 ? 300 : 0;
  }
  const LevelFace face = sliced(cube, 1'000'000).report.level;
  EXPECT_EQ(face.area_um2, 2'000'000u);
  EXPECT_EQ(face.plane, 1'000'000);
  EXPECT_EQ(sliced(cube, 1'000'200).report.level.area_um2, 0u);
  EXPECT_EQ(sliced(cube, 998'900).report.level.area_um2, 0u);
}

TEST(Slice, CornersEdgesAndFacesInThePlaneCountOnce) {
  // Every facet orientation, with many corners exactly in the plane: area by the bitmap's rule at points between them.
  std::mt19937 random(11);
  std::uniform_int_distribution<Nm> pick(0, 4);
  for (int i = 0; i < 400; ++i) {
    const Triangles some = random_tetrahedra(1 + i % 3, [&] {
      return Point3{pick(random) * 100, pick(random) * 100, pick(random) * 100};
    });
    for (const Nm z : {100, 150, 200}) {
      const Sliced result = sliced(some, z);
      EXPECT_EQ(result.report.gaps.open, 0u);
      expect_clean(result.contours.contours, "tetrahedra " + std::to_string(i) + " at " + std::to_string(z));
      if (testing::Test::HasFailure()) return;
    }
  }
}

TEST(Slice, UnionFollowsTheFillRule) {
  const Triangles a = box({0, 0, 0}, {1000, 1000, 1000}), b = box({500, 500, 0}, {1500, 1500, 1000});
  const auto area = [&](const Triangles& triangles, FillRule rule) {
    slice::SliceOptions options;
    options.fill_rule = rule;
    const Sliced result = sliced(triangles, 500, options);
    expect_clean(result.contours.contours, "boxes");
    return square(result);
  };
  EXPECT_EQ(area(joined({a, b}), FillRule::kNonzero), 1.75e6);
  EXPECT_EQ(area(joined({a, b}), FillRule::kEvenOdd), 1.5e6);
  EXPECT_EQ(area(joined({a, reversed(b)}), FillRule::kPositive), 0.75e6);
  const Triangles inner = box({200, 200, 0}, {700, 700, 1000});
  EXPECT_EQ(area(joined({a, inner}), FillRule::kNonzero), 1e6);
  EXPECT_EQ(area(joined({a, inner}), FillRule::kEvenOdd), 0.75e6);
  EXPECT_EQ(area(joined({a, reversed(inner)}), FillRule::kNonzero), 0.75e6);
  EXPECT_EQ(area(reversed(a), FillRule::kNonzero), 1e6);
  EXPECT_EQ(area(reversed(a), FillRule::kPositive), 0);
  // Side by side with a face in common, twice the same, and touching along one edge.
  EXPECT_EQ(area(joined({a, moved(a, {1000, 0, 0})}), FillRule::kNonzero), 2e6);
  EXPECT_EQ(area(joined({a, a}), FillRule::kNonzero), 1e6);
  EXPECT_EQ(area(joined({a, moved(a, {1000, 1000, 0})}), FillRule::kNonzero), 2e6);
}

TEST(Slice, WhatIsInContactIsMergedWhereverItLies) {
  // Crossing boxes within a solid, within a hole of it, and within an island in that hole; whole ones next to them.
  const Triangles crossing = joined({box({0, 0, 0}, {100, 100, 1000}), box({50, 50, 0}, {150, 150, 1000})});
  const Triangles holes = reversed(moved(crossing, {1300, 300, 0}));
  const Triangles all =
      joined({box({0, 0, 0}, {2000, 2000, 1000}), moved(crossing, {300, 300, 0}), holes,
              reversed(box({400, 1000, 0}, {1600, 1900, 1000})), moved(crossing, {500, 1100, 0}),
              box({900, 1100, 0}, {1500, 1800, 1000}), reversed(moved(crossing, {1000, 1200, 0})),
              moved(box({0, 0, 0}, {50, 50, 1000}), {1700, 100, 0}), moved(box({0, 0, 0}, {50, 50, 1000}), {450, 1700, 0})});
  const double cross = 17'500, solid = 4e6 - 1200 * 900, in_hole = cross + 600 * 700 + 2500;
  for (const auto& [rule, area] : {std::pair{FillRule::kNonzero, solid - cross + in_hole - cross},
                                   {FillRule::kPositive, solid - cross + in_hole - cross}}) {
    slice::SliceOptions options;
    options.fill_rule = rule;
    const Sliced result = sliced(all, 500, options);
    EXPECT_EQ(result.report.merged, 4u);
    expect_clean(result.contours.contours, "crossing boxes");
    // The two boxes that are holes overlap in 50 x 50: there the winding number is -1, which nonzero takes for solid.
    EXPECT_EQ(square(result), area + (rule == FillRule::kNonzero ? 2 * 2500 : 0));
  }
}

TEST(Slice, IslandsInHolesAlternate) {
  Triangles all;
  for (int depth = 0; depth < 9; ++depth) {
    const Triangles ring = box({depth * 100, depth * 100, 0}, {2000 - depth * 100, 2000 - depth * 100, 1000});
    all = joined({all, depth % 2 == 0 ? ring : reversed(ring)});
  }
  const Sliced result = sliced(all, 500);
  EXPECT_EQ(result.contours.contours.size(), 9u);
  EXPECT_EQ(result.report.merged, 0u) << "contours that keep clear need no boolean operation";
  expect_clean(result.contours.contours, "rings");
}

TEST(Slice, GapsAreClosedUpToTheStatedDistanceAndTheRestIsReported) {
  Triangles cube = box({0, 0, 0}, {1'000'000, 1'000'000, 1'000'000});
  for (Triangle& t : cube) {  // one wall 40 um away from the others, without its edges in common
    if (t.a.x == 0 && t.b.x == 0 && t.c.x == 0) {
      for (Point3* p : {&t.a, &t.b, &t.c}) p->x = -40'000;
    }
  }
  slice::SliceOptions options;
  options.gap = 39'999;
  Sliced result = sliced(cube, 500'000, options);
  EXPECT_EQ(result.report.gaps.open, 2u);
  EXPECT_EQ(result.contours.contours.size(), 0u);
  options.gap = 40'000;
  result = sliced(cube, 500'000, options);
  EXPECT_EQ(result.report.gaps.open, 0u);
  EXPECT_EQ(result.report.gaps.closed, 2u);
  EXPECT_EQ(result.report.gaps.largest_closed, 40'000);
  EXPECT_EQ(square(result), 1.04e12);
}

TEST(Slice, PlanesOutOfOrderNameTheFirstBadOne) {
  const std::vector<Mesh> meshes{make_mesh(box({0, 0, 0}, {10, 10, 10}))};
  const std::vector<Instance> instances{{0, {0, 0, 0}}};
  const std::vector<std::uint32_t> body{0};
  const std::vector<Nm> planes{1, 5, 5, 7};
  const auto slicer = slice::Slicer::build(meshes, instances, body, planes, {});
  ASSERT_FALSE(slicer.ok());
  EXPECT_EQ(slicer.error().fault, Fault::kUsage);
  EXPECT_NE(slicer.error().message.find("plane 2"), std::string::npos);
}

TEST(PlaneIndex, FindsExactlyTheFacetsThatAPlaneCrossesForAnyPlanes) {
  std::mt19937 random(3);
  std::uniform_int_distribution<Nm> pick(-5000, 5000);
  std::vector<Triangle> triangles(3000);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Nm tall = i % 7 == 0 ? 5000 : 40, z = pick(random);
    const auto corner = [&] { return Point3{pick(random), pick(random), static_cast<Nm>(z + pick(random) % tall)}; };
    triangles[i] = {corner(), corner(), corner()};
  }
  for (const int spread : {1, 3, 400}) {
    std::vector<std::int64_t> planes;
    for (std::int64_t z = -6000; z < 6000; z += 1 + static_cast<std::int64_t>(random() % static_cast<unsigned>(spread)))
      planes.push_back(z);
    const slice::PlaneIndex index = slice::index_crossings(triangles, planes);
    Buffer<std::uint32_t> found, facets, order;
    Buffer<Triangle> shown;
    for (std::uint32_t p = 0; p < planes.size(); p += static_cast<std::uint32_t>(1 + planes.size() / 200)) {
      found.clear();
      index.append(p, found);
      EXPECT_LE(found.size(), index.max_found(p));
      std::vector<std::uint32_t> expected;
      for (std::uint32_t t = 0; t < triangles.size(); ++t) {
        const auto [low, high] = std::minmax({triangles[t].a.z, triangles[t].b.z, triangles[t].c.z});
        if (low <= planes[p] + 100 && planes[p] + 100 < high) expected.push_back(t);
      }
      std::sort(found.begin(), found.end());
      ASSERT_TRUE(std::ranges::equal(found, expected)) << "plane " << p << " of " << planes.size();
    }
  }
}

TEST(PlaneIndex, OfBlocksFindsTheSameFacetsInTheSameOrderAsThatOfTheList) {
  std::mt19937 random(4);
  std::uniform_int_distribution<Nm> pick(-500'000, 500'000);
  Buffer<Triangle> triangles(2 * kBlockSize + 1234);
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    const Nm tall = i % 7 == 0 ? 500'000 : 4000, z = pick(random);
    const auto corner = [&] { return Point3{pick(random), pick(random), static_cast<Nm>(z + pick(random) % tall)}; };
    // In the second block each vertex is shared, so that it is stored by numbers.
    const Triangle before = triangles[i == 0 ? 0 : i - 1];
    triangles[i] = i / kBlockSize == 1 ? Triangle{before.b, before.c, before.a} : Triangle{corner(), corner(), corner()};
    if (i / kBlockSize == 1 && i % 3 == 0) triangles[i].b = corner();
  }
  MeshBlocks blocks(static_cast<std::uint32_t>(triangles.size()), 0, true);
  BlockMaker maker;
  for (std::uint32_t b = 0; b < blocks.block_count(); ++b)
    maker.make(std::span<const Triangle>(triangles).subspan(blocks.first_triangle(b), blocks.triangles_in(b)), blocks, b);
  blocks.seal();
  ASSERT_NE(blocks.indexed(MeshBlocks::kClusters).cluster, nullptr);
  ASSERT_EQ(blocks.indexed(0).cluster, nullptr);
  for (const std::int64_t step : {700, 9000, 200'000}) {
    std::vector<std::int64_t> planes;
    for (std::int64_t z = -600'000; z < 600'000; z += step) planes.push_back(z);
    const slice::PlaneIndex index = slice::index_crossings(triangles, planes);
    const slice::BlockPlanes of_blocks(blocks, planes);
    slice::BlockScratch scratch;
    Buffer<std::uint32_t> found, facets, order;
    Buffer<Triangle> shown;
    for (std::uint32_t p = 0; p < planes.size(); p += static_cast<std::uint32_t>(1 + planes.size() / 50)) {
      found.clear();
      index.append(p, found);
      shown.clear();
      of_blocks.find(p, scratch, facets, order,
                     [&](std::span<const Triangle> some) { shown.insert(shown.end(), some.begin(), some.end()); });
      ASSERT_EQ(of_blocks.count(p), found.size());
      ASSERT_EQ(order.size(), found.size());
      ASSERT_EQ(shown.size(), found.size());
      for (std::size_t i = 0; i < found.size(); ++i) {
        ASSERT_EQ(shown[order[i]], triangles[found[i]]) << p << " " << i;
        ASSERT_EQ(slice::facet_of(blocks, facets[order[i]]), triangles[found[i]]) << p << " " << i;
      }
    }
  }
  Buffer<Triangle> list(kBlockSize);
  for (std::uint32_t b = 0; b < blocks.block_count(); ++b) {
    blocks.list_block(b, list);
    for (std::uint32_t i = 0; i < blocks.triangles_in(b); ++i) ASSERT_EQ(list[i], triangles[blocks.first_triangle(b) + i]);
  }
}

TEST(Chain, SeparatesEdgesWhoseHashesAreEqual) {
  // Of 320,000 hashes of 32 bits some are equal.
  constexpr std::uint32_t kCount = 80'000;
  std::mt19937 random(3);
  std::uniform_int_distribution<Nm> pick(1, 1'000'000'000);
  const Triangles triangles = random_tetrahedra(kCount, [&, n = 0]() mutable {
    const Nm side = n++ % 4 < 2 ? 1 : -1;
    return Point3{pick(random), pick(random), side * pick(random)};
  });
  std::vector<std::uint32_t> at(triangles.size());
  std::iota(at.begin(), at.end(), 0u);
  std::ranges::shuffle(at, random);
  slice::Cuts cuts;
  slice::ChainScratch scratch;
  Contours closed, open;
  slice::cut(triangles, at, 0, cuts);
  slice::chain({triangles, nullptr, at, true}, cuts, 0, scratch, closed, open);
  EXPECT_EQ(open.size(), 0u);
  ASSERT_EQ(closed.size(), kCount);
  for (std::uint32_t c = 0; c < kCount; ++c) ASSERT_EQ(closed[c].size(), 4u);
}

TEST(Copies, MoveTheContoursOfALayerAFewTimesOnly) {
  Contours square, all;
  for (const Point2 p : {Point2{0, 0}, {5, 0}, {5, 5}, {0, 5}}) square.point.push_back(p);
  square.close();
  VoxelStack stack(8, 8, {1, 1, 1});
  const Buffer<std::uint32_t> offset(9, 0u);
  std::uint32_t moves = 0, stack_moves = 0;
  for (Nm copy = 0; copy < 10'000; ++copy) {
    const Point2* const before = all.point.data();
    slice::append_moved(square, {copy, 2 * copy}, all);
    moves += all.point.data() != before;
    const std::uint32_t* const rows_before = stack.row_offset.data();
    ASSERT_TRUE(stack.append({8, offset, {}}));
    stack_moves += stack.row_offset.data() != rows_before;
  }
  ASSERT_EQ(all.size(), 10'000u);
  EXPECT_EQ(all[9999][2], (Point2{10'004, 20'003}));
  // A buffer that grows by what each copy needs moves 10,000 times, and the time of a layer is the square of its copies.
  EXPECT_LT(moves, 40u);
  EXPECT_LT(stack_moves, 40u);
}

TEST(Tidy, DroppedPointsLieWithinTheToleranceAndStraightOnesAlwaysGo) {
  std::mt19937 random(5);
  Contours circle;
  for (int i = 0; i < 2000; ++i) {
    const double turn = 2 * 3.14159265358979 * i / 2000;
    const double r = 5e6 + static_cast<double>(random() % 2000);
    circle.point.push_back({static_cast<Nm>(r * std::cos(turn)), static_cast<Nm>(r * std::sin(turn))});
  }
  circle.close();
  SimplifyScratch scratch;
  for (const Nm tolerance : {1000, 10'000, 100'000}) {
    Contours less = circle;
    simplify(less, tolerance, scratch);
    EXPECT_LT(less.point.size(), circle.point.size());
    for (const Point2 p : circle.point) ASSERT_LE(distance_to(less, p.x, p.y), tolerance + 1e-3);
  }
  Contours square;
  for (const Point2 p :
       {Point2{0, 0}, {0, 0}, {5, 0}, {10, 0}, {10, 5}, {14, 5}, {10, 5}, {10, 10}, {5, 10}, {0, 10}, {0, 4}}) {
    square.point.push_back(p);
  }
  square.close();
  for (const Point2 p : {Point2{0, 0}, {5, 5}, {9, 9}, {3, 3}}) square.point.push_back(p);  // no area
  square.close();
  tidy(square);
  ASSERT_EQ(square.size(), 1u);
  EXPECT_EQ(square.point.size(), 4u);
  EXPECT_TRUE(doubled_area(square) == 200);
}

TEST(Contact, IsFoundExactlyWhereAnyTwoEdgesMeet) {
  std::mt19937 random(17);
  ContactScratch scratch;
  Buffer<std::uint32_t> group;
  int with = 0;
  for (int i = 0; i < 3000; ++i) {
    std::uniform_int_distribution<Nm> pick(0, i % 3 == 0 ? 12 : 1'000'000);
    Contours contours;
    for (int c = 0; c < 1 + i % 4; ++c) {
      for (int k = 0; k < 3 + i % 3; ++k) contours.point.push_back({pick(random), pick(random)});
      contours.close();
    }
    tidy(contours);
    bool expected = false;
    const auto side = [](Point2 a, Point2 b, Point2 p) {
      const std::int64_t area =
          (std::int64_t{b.x} - a.x) * (std::int64_t{p.y} - a.y) - (std::int64_t{b.y} - a.y) * (std::int64_t{p.x} - a.x);
      return area > 0 ? 1 : area < 0 ? -1 : 0;
    };
    struct ContourSegment {
      Point2 a, b;
      std::uint32_t c, k, n;
    };
    std::vector<ContourSegment> all;
    for (std::uint32_t c = 0; c < contours.size(); ++c) {
      const auto n = static_cast<std::uint32_t>(contours[c].size());
      for (std::uint32_t k = 0; k < n; ++k) all.push_back({contours[c][k], contours[c][(k + 1) % n], c, k, n});
    }
    for (std::size_t p = 0; p < all.size(); ++p) {
      for (std::size_t q = p + 1; q < all.size(); ++q) {
        const ContourSegment& s = all[p];
        const ContourSegment& t = all[q];
        if (s.c == t.c && ((s.k + 1) % s.n == t.k || (t.k + 1) % t.n == s.k)) continue;
        const bool apart = std::max(s.a.x, s.b.x) < std::min(t.a.x, t.b.x) || std::max(t.a.x, t.b.x) < std::min(s.a.x, s.b.x) ||
                           std::max(s.a.y, s.b.y) < std::min(t.a.y, t.b.y) || std::max(t.a.y, t.b.y) < std::min(s.a.y, s.b.y);
        if (!apart && side(s.a, s.b, t.a) * side(s.a, s.b, t.b) <= 0 && side(t.a, t.b, s.a) * side(t.a, t.b, s.b) <= 0)
          expected = true;
      }
    }
    with += expected ? 1 : 0;
    ASSERT_EQ(find_contacts(contours, scratch, group), expected) << "case " << i;
  }
  EXPECT_GT(with, 500);
  EXPECT_LT(with, 2900);
}

TEST(Offset, MovesStraightEdgesByTheDistanceAndDropsWhatShrinksAway) {
  Contours frame;
  for (const Point2 p : {Point2{0, 0}, {10'000, 0}, {10'000, 8'000}, {0, 8'000}}) frame.point.push_back(p);
  frame.close();
  for (const Point2 p : {Point2{4'000, 4'000}, {4'000, 5'000}, {5'000, 5'000}, {5'000, 4'000}}) frame.point.push_back(p);
  frame.close();
  const auto area = [&](std::int64_t distance) {
    const auto moved = offset_contours(frame, distance);
    EXPECT_TRUE(moved.ok());
    expect_clean(*moved, "frame");
    return static_cast<double>(doubled_area(*moved)) / 2;
  };
  EXPECT_EQ(area(0), 79e6);
  EXPECT_EQ(area(-1000), 8000.0 * 6000 - 3000.0 * 3000);
  EXPECT_EQ(area(400), 10'800.0 * 8'800 - 200.0 * 200);
  EXPECT_EQ(area(500), 11'000.0 * 9'000);
  EXPECT_EQ(area(-4000), 0);
}

}  // namespace
}  // namespace lamina::test
