// tests/slice/test_simplify.cpp: contours with points left out compared with the full ones, in whole numbers.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <numbers>
#include <random>

#include "stages/geometry/contours/contact.h"
#include "stages/geometry/contours/simplify.h"
#include "stages/load/load.h"
#include "stages/slice/slice.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Wide = __int128;

/// Whether p is further from the stretch ab than the tolerance. Squares of areas are compared in halves of 64 bits.
bool is_beyond(Point2 p, Point2 a, Point2 b, Nm tolerance) {
  const Wide ux = std::int64_t{b.x} - a.x, uy = std::int64_t{b.y} - a.y, vx = std::int64_t{p.x} - a.x,
             vy = std::int64_t{p.y} - a.y;
  const Wide along = ux * vx + uy * vy, length2 = ux * ux + uy * uy, max2 = Wide{tolerance} * tolerance;
  if (along <= 0) return vx * vx + vy * vy > max2;
  if (along >= length2) return (vx - ux) * (vx - ux) + (vy - uy) * (vy - uy) > max2;
  Wide area = ux * vy - uy * vx;
  if (area < 0) area = -area;
  // area^2 > most2 length2, without 128 bits running over: area / length > tolerance, whole part and rest
  const Wide whole = area / length2, rest = area % length2;  // area^2 / length2 = whole area + rest area / length2
  const Wide high = whole * area + rest * area / length2;    // rounded down
  if (high != max2) return high > max2;
  return rest * area % length2 != 0;
}

struct Measured {
  std::uint64_t full = 0, left = 0, contours = 0, whole = 0, of_whole = 0;
};

/// What simplify() promises of one contour: points of the full one, in its order; all left out within the tolerance of the
/// stretch that stands for them; none that may go still there.
void compare_contour(std::span<const Point2> full, std::span<const Point2> less, Nm tolerance, Measured& measured) {
  ++measured.contours;
  measured.full += full.size();
  measured.left += less.size();
  if (less.size() == full.size()) ++measured.whole, measured.of_whole += full.size();
  ASSERT_GE(less.size(), 3u);
  std::vector<std::size_t> position;
  for (std::size_t i = 0; i < full.size() && position.size() < less.size(); ++i) {
    if (full[i] == less[position.size()]) position.push_back(i);
  }
  ASSERT_EQ(position.size(), less.size()) << "a point that is not in the full contour, or out of order";
  const std::size_t n = full.size(), count = position.size();
  const auto replaces = [&](std::size_t from, std::size_t to) {
    for (std::size_t i = from + 1; i < (to > from ? to : to + n); ++i) {
      if (is_beyond(full[i % n], full[from], full[to], tolerance)) return false;
    }
    return true;
  };
  for (std::size_t k = 0; k < count; ++k) ASSERT_TRUE(replaces(position[k], position[(k + 1) % count])) << "moved further";
  if (count == 3 || count == n) return;
  for (std::size_t k = 0; k < count; ++k) {
    ASSERT_FALSE(replaces(position[(k + count - 1) % count], position[(k + 1) % count])) << "point " << k << " may go";
  }
}

void compare(const ContoursView& full, const ContoursView& less, Nm tolerance, Measured& measured) {
  ASSERT_EQ(full.size(), less.size()) << "a contour is lost";
  for (std::uint32_t c = 0; c < full.size(); ++c) {
    SCOPED_TRACE("contour " + std::to_string(c));
    compare_contour(full[c], less[c], tolerance, measured);
    ASSERT_EQ(doubled_area(full[c]) > 0, doubled_area(less[c]) > 0);
    if (testing::Test::HasFatalFailure()) return;
  }
}

/// Whether any two edges meet that are not neighbours, each compared with each.
bool any_meet(const ContoursView& contours) {
  std::vector<std::array<Point2, 2>> edge;
  std::vector<std::size_t> next;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    const auto points = contours[c];
    for (std::size_t i = 0; i < points.size(); ++i) {
      next.push_back(i + 1 < points.size() ? edge.size() + 1 : edge.size() + 1 - points.size());
      edge.push_back({points[i], points[(i + 1) % points.size()]});
    }
  }
  for (std::size_t i = 0; i < edge.size(); ++i) {
    for (std::size_t j = i + 1; j < edge.size(); ++j) {
      if (next[i] != j && next[j] != i && intervals_meet(edge[i][0], edge[i][1], edge[j][0], edge[j][1])) return true;
    }
  }
  return false;
}

Contours simplified(const Contours& full, Nm tolerance) {
  Contours less = full;
  SimplifyScratch scratch;
  simplify(less, tolerance, scratch);
  return less;
}

void add(Contours& contours, std::initializer_list<Point2> points) {
  contours.point.insert(contours.point.end(), points);
  contours.close();
}

/// A ring about a centre whose radius wavers, counter-clockwise or clockwise.
void add_ring(Contours& contours, Point2 centre, double radius, double wavers, int points, bool hole, std::mt19937& random) {
  std::uniform_real_distribution<double> part(-wavers, wavers);
  for (int i = 0; i < points; ++i) {
    const double turn = (hole ? -2 : 2) * std::numbers::pi * i / points, r = radius + part(random);
    contours.point.push_back({static_cast<Nm>(centre.x + r * std::cos(turn)), static_cast<Nm>(centre.y + r * std::sin(turn))});
  }
  contours.close();
}

TEST(Simplify, RingsInRingsStayWithinTheToleranceAndAsCleanAsTheyWere) {
  std::mt19937 random(23);
  Measured measured;
  for (int i = 0; i < 400; ++i) {
    const Nm tolerance = std::array{100, 3'000, 10'000, 60'000}[static_cast<std::size_t>(i % 4)];
    const double wavers = tolerance * std::array{0.1, 0.7, 1.5}[static_cast<std::size_t>(i % 3)];
    Contours full;
    // Walls from several tolerances down to a fraction of one: there simplified rings would cross.
    const double wall = 2 * wavers + tolerance * std::array{0.2, 1.0, 6.0}[static_cast<std::size_t>(i / 3 % 3)];
    double radius = 1'000'000;
    for (int k = 0; k < 4 && radius > 20 * wall; ++k, radius -= wall) {
      add_ring(full, {0, 0}, radius, wavers, 40 + i % 50, k % 2 == 1, random);
    }
    if (any_meet(full)) continue;
    const Contours less = simplified(full, tolerance);
    compare(full, less, tolerance, measured);
    ASSERT_FALSE(any_meet(less)) << i;
    for (std::uint32_t c = 0; c < less.size(); ++c) {
      ASSERT_EQ(winding_about(less, less[c].front(), c), winding_about(full, full[c].front(), c)) << i;
    }
    if (HasFatalFailure()) return;
  }
  EXPECT_GT(measured.contours, 300u);
  EXPECT_GT(measured.whole, 10u) << "no ring was in danger";
  EXPECT_LT(measured.left, measured.full * 9 / 10);
}

TEST(Simplify, ToleranceCountsToTheNanometre) {
  // A point 10,000 nm from the long side, 3 : 4 : 5.
  Contours full;
  add(full, {{0, 0}, {1'500'000 + 8'000, 2'000'000 - 6'000}, {3'000'000, 4'000'000}, {-4'000'000, 3'000'000}});
  EXPECT_EQ(simplified(full, 10'000).point.size(), 3u);
  EXPECT_EQ(simplified(full, 9'999).point.size(), 4u);
  // At the reach of beds, where squares need 128 bits.
  Contours wide;
  add(wide,
      {{-1'000'000'000, -1'000'000'000}, {999, -1'000'000'000 - 10'000}, {1'000'000'000, -1'000'000'000}, {0, 1'000'000'000}});
  EXPECT_EQ(simplified(wide, 10'000).point.size(), 3u);
  EXPECT_EQ(simplified(wide, 9'999).point.size(), 4u);
  EXPECT_TRUE(simplified(wide, 0).point == wide.point);
}

// Teeth 10 mm high and 40 um wide at their feet, each a little lower: the furthest points split them off one by one.
TEST(Simplify, ACombOfManyTeethTakesNoLongerThanItsPoints) {
  for (const int teeth : {500, 50'000}) {
    Contours full;
    for (int i = 0; i < teeth; ++i) {
      const Nm x = i * 40'000;
      full.point.push_back({x, 0});
      full.point.push_back({x + 10'000, i % 7});  // says little, and goes
      full.point.push_back({x + 20'000, 10'000'000 - i / 50});
    }
    full.point.push_back({teeth * 40'000, 0});
    full.point.push_back({teeth * 40'000, -1'000'000});
    full.point.push_back({0, -1'000'000});
    full.close();
    Contours less = full;
    SimplifyScratch scratch;
    simplify(less, 10'000, scratch);
    // 8 x 18 tests per point, then intervals of at most 7/8: 89 levels. Testing all teeth for each takes 25,000 a point.
    EXPECT_LT(scratch.inspections, 400 * full.point.size());
    EXPECT_EQ(less.point.size(), static_cast<std::size_t>(2 * teeth + 1));
    Measured measured;
    compare(full, less, 10'000, measured);
    if (teeth == 500) {
      EXPECT_FALSE(any_meet(less));
    }
  }
}

TEST(Simplify, WhatWouldBreakStaysAsItIs) {
  // A ring thinner than the tolerance, one smaller than it.
  Contours thin;
  add(thin, {{0, 0}, {1'000'000, -3'000}, {2'000'000, 0}, {1'000'000, 3'000}});
  add(thin, {{5'000'000, 0}, {5'002'000, 0}, {5'002'000, 2'000}, {5'000'000, 2'000}});
  EXPECT_TRUE(simplified(thin, 10'000).point == thin.point);
  // A hole of 4 um behind a bulge of 8 um, which leaves it outside where it is left out.
  Contours behind;
  add(behind, {{0, 0}, {1'000'000, -8'000}, {2'000'000, 0}, {2'000'000, 2'000'000}, {0, 2'000'000}});
  EXPECT_EQ(simplified(behind, 10'000).point.size(), 4u);
  add(behind, {{998'000, -6'500}, {998'000, -2'500}, {1'002'000, -2'500}, {1'002'000, -6'500}});
  const Contours less = simplified(behind, 10'000);
  EXPECT_TRUE(less.point == behind.point);
  // A slit of 5 um between two combs of one contour.
  Contours slit;
  add(slit, {{0, 0},
             {3'000'000, 0},
             {3'000'000, 1'000'000},
             {2'000'000, 1'006'000},
             {1'000'000, 1'000'000},
             {1'000'000, 1'005'000},
             {2'000'000, 1'011'000},
             {3'000'000, 1'005'000},
             {3'000'000, 2'000'000},
             {0, 2'000'000}});
  ASSERT_FALSE(any_meet(slit));
  const Contours kept = simplified(slit, 8'000);
  EXPECT_FALSE(any_meet(kept));
  Measured measured;
  compare(slit, kept, 8'000, measured);
}

struct OfPart {
  Measured measured;
  std::uint32_t layers = 0;
};

void compare_part(const fs::path& file, std::int64_t layers, OfPart& found) {
  load::LoadOptions load_options;
  auto part = load::load(file.string(), load_options);
  ASSERT_TRUE(part.ok()) << part.error().message;
  const std::vector<std::uint32_t> body(part->instances.size(), 0);
  std::vector<Nm> planes;
  for (std::int64_t i = 0; i < layers; ++i) {
    planes.push_back(static_cast<Nm>(part->bounds.lo.z + part->bounds.height() * (2 * i + 1) / (2 * layers)));
  }
  const auto cut = [&](Nm tolerance) {
    slice::SliceOptions options;
    options.tolerance = tolerance;
    auto slicer = slice::Slicer::build(part->meshes, part->instances, body, planes, options);
    EXPECT_TRUE(slicer.ok());
    std::vector<slice::LayerContours> sliced(planes.size());
    tbb::parallel_for(std::size_t{0}, planes.size(), [&](std::size_t p) {
      slice::SectionScratch scratch;
      EXPECT_TRUE(slicer->layer(static_cast<std::uint32_t>(p), scratch, sliced[p]).ok());
    });
    return sliced;
  };
  constexpr Nm kTolerance = 10'000;
  const auto full = cut(0), less = cut(kTolerance);
  for (std::size_t p = 0; p < planes.size(); ++p) {
    SCOPED_TRACE(file.filename().string() + " at z " + std::to_string(planes[p]));
    compare(full[p].contours, less[p].contours, kTolerance, found.measured);
    if (less[p].contours.point.size() < 20'000) expect_clean(less[p].contours, "simplified");
    if (testing::Test::HasFailure()) return;
    ++found.layers;
  }
}

void compare_parts(const fs::path& folder, std::span<const char* const> names, std::int64_t layers) {
  OfPart found;
  for (const char* name : names) compare_part(folder / name, layers, found);
  const Measured& m = found.measured;
  EXPECT_LT(m.left, m.full);
  std::cout << found.layers << " layers, " << m.contours << " contours: " << m.left << " of " << m.full << " points stay; "
            << m.whole << " contours keep all their " << m.of_whole << '\n';
}

TEST(Simplify, ContoursOfTheCorpusAreWithin10MicrometresOfTheFullOnes) {
  constexpr const char* kParts[] = {"nist_am_test_artifact_v3b.stl", "dental_crown.stl", "quad_knot.obj",
                                    "rabbit_9_overlapping_shells.obj", "cube_gears_17_items.3mf"};
  compare_parts(fs::path(LAMINA_TEST_DIR) / "corpus", kParts, 25);
}

TEST(Simplify, ContoursOfRealModelsAreWithin10MicrometresOfTheFullOnes) {
  const char* folder = std::getenv("LAMINA_MODELS");
  if (folder == nullptr) GTEST_SKIP() << "LAMINA_MODELS is not set: large real parts were NOT simplified";
  constexpr const char* kParts[] = {"3DBenchy.3mf",
                                    "stanford_bunny.stl",
                                    "nefertiti.obj",
                                    "spiral_lattice_cone_1.stl",
                                    "herringbone_wheels_x4.stl",
                                    "screw_cap_insert_threads.stl",
                                    "am_coin_embossed_text.stl",
                                    "gyroid_sheet_cyl_247k.stl.gz",
                                    "st_helens_terrain_645k.stl.gz"};
  compare_parts(folder, kParts, 60);
}

}  // namespace
}  // namespace lamina::test
