// Both engines against the contract, on solids whose edges, corners and faces lie exactly on rows, columns and planes.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "stages/geometry/isa.h"
#include "stages/raster/raster.h"
#include "tests/raster/reference.h"
#include "tests/raster/shapes.h"

namespace lamina::test {
namespace {

using raster::Engine;

std::string position_of_difference(const RunsView& a, const RunsView& b) {
  if (a.rows() != b.rows()) return "row counts differ";
  for (std::uint32_t r = 0; r < a.rows(); ++r) {
    const auto x = a.row(r), y = b.row(r);
    if (std::equal(x.begin(), x.end(), y.begin(), y.end())) continue;
    std::string text = "row " + std::to_string(r) + ":";
    for (auto c : x) text += " " + std::to_string(c);
    text += " |";
    for (auto c : y) text += " " + std::to_string(c);
    return text;
  }
  return {};
}

/// The kernels to test a rule with: each of those that this processor has is somebody's.
Isa isa_for(FillRule rule) {
  const Isa wanted = rule == FillRule::kNonzero ? Isa::kAvx512 : rule == FillRule::kPositive ? Isa::kAvx2 : Isa::kPlain;
  return std::min(wanted, widest_isa());
}

/// Compares both engines with the reference at every plane and under every rule. Returns the pixels set in all.
std::uint64_t expect_exact(const Triangles& triangles, const PixelGrid& grid, const std::vector<Nm>& planes,
                           const std::vector<Point3>& copies = {{0, 0, 0}}) {
  std::uint64_t pixels = 0;
  Triangles all;
  std::vector<Instance> instances;
  for (const Point3& offset : copies) {
    const Triangles copy = moved(triangles, offset);
    all.insert(all.end(), copy.begin(), copy.end());
    instances.push_back({0, offset});
  }
  for (FillRule rule : {FillRule::kNonzero, FillRule::kPositive, FillRule::kEvenOdd}) {
    Mesh mesh = make_mesh(triangles);
    auto rasterizer = raster::Rasterizer::build({&mesh, 1}, instances, grid, rule, true, true, isa_for(rule));
    EXPECT_TRUE(rasterizer.ok());
    raster::LayerScratch scratch;
    Runs runs;
    for (Nm plane : planes) {
      const Runs expected = reference_layer(all, grid, plane, rule);
      pixels += set_pixels(expected);
      for (Engine engine : {Engine::kRays, Engine::kContours}) {
        const auto report = rasterizer->layer(engine, plane, scratch, runs);
        EXPECT_EQ(position_of_difference(runs, expected), "")
            << (engine == Engine::kRays ? "rays" : "contours") << " at " << plane << " nm";
        EXPECT_EQ(report.open_rows, 0u);
        EXPECT_LE(report.crossings, rasterizer->crossings_bound(plane));
      }
      if (testing::Test::HasFailure()) return pixels;
    }
  }
  return pixels;
}

TEST(Engines, AgreeWithTheContractOnABoxWhoseFacesLieOnPixelCentres) {
  // 254 dpi: centres at 0.05 + 0.1 i mm exactly.
  const PixelGrid grid{{254, 10'000'000}, {254, 8'000'000}};
  const Triangles part = box({1'050'000, 1'050'000, 0}, {4'050'000, 3'050'000, 2'000'000});
  EXPECT_GT(expect_exact(part, grid, {0, 1, 999'999, 1'000'000, 1'999'999, 2'000'000}), 0u);
}

TEST(Engines, CountAnEdgeOnAPixelCentreOnce) {
  // Two boxes that share a face exactly on a column of centres: no pixel of the seam is missing or doubled.
  const PixelGrid grid{{254, 10'000'000}, {254, 8'000'000}};
  Triangles part = box({1'050'000, 1'000'000, 0}, {2'050'000, 3'000'000, 1'000'000});
  const Triangles right = box({2'050'000, 1'000'000, 0}, {3'050'000, 3'000'000, 1'000'000});
  part.insert(part.end(), right.begin(), right.end());
  expect_exact(part, grid, {500'000});
  Mesh mesh = make_mesh(part);
  const Instance instance{0, {0, 0, 0}};
  auto rasterizer = raster::Rasterizer::build({&mesh, 1}, {&instance, 1}, grid, FillRule::kEvenOdd, true, false);
  raster::LayerScratch scratch;
  Runs runs;
  rasterizer->layer(Engine::kRays, 500'000, scratch, runs);
  EXPECT_EQ(set_pixels(runs), 20u * 20u);  // 2 mm x 2 mm at 0.1 mm, even under even-odd
}

TEST(Engines, AgreeOnTetrahedraWithCornersOnCentresAndPlanes) {
  const PixelGrid grid{{254, 6'000'000}, {508, 5'000'000}};
  std::uint64_t pixels = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    const auto pick = [&] {
      const auto axis = [&](int count, int step, int first) {
        return static_cast<Nm>(first + step * static_cast<int>(random() % static_cast<unsigned>(count)));
      };
      return Point3{axis(58, 100'000, 50'000), axis(98, 50'000, 25'000), axis(8, 250'000, 0)};
    };
    pixels += expect_exact(random_tetrahedra(8, pick), grid, {0, 125'000, 250'000, 500'000, 1'000'000, 1'499'999});
    if (HasFailure()) FAIL() << "seed " << seed;
  }
  EXPECT_GT(pixels, 0u);
}

TEST(Engines, AgreeOnTetrahedraAnywhereAndOnNeedles) {
  const PixelGrid whole{{1200, 30'000'000}, {600, 25'000'000}};
  const PixelGrid decimal{{pitch_of_dpi(1234.5678), 30'000'000}, {pitch_of_dpi(540.43), 25'000'000}};
  for (unsigned seed = 0; seed < 40; ++seed) {
    const PixelGrid& grid = seed % 4 == 3 ? decimal : whole;
    std::mt19937 random(1000 + seed);
    const int flat = static_cast<int>(random() % 4);  // some are needles along x, along y, or nearly horizontal
    const auto pick = [&] {
      const auto any = [&](std::int64_t span) { return static_cast<Nm>(random() % static_cast<std::uint64_t>(span)); };
      Point3 p{any(30'000'000), any(25'000'000), any(2'000'000)};
      if (flat == 1) p.y = 12'345'678 + any(40);
      if (flat == 2) p.x = 20'000'003 + any(40);
      if (flat == 3) p.z = 999'990 + any(20);
      return p;
    };
    expect_exact(random_tetrahedra(20, pick), grid, {3, 500'000, 999'999, 1'000'000, 1'000'005, 1'700'001});
    if (HasFailure()) FAIL() << "seed " << seed;
  }
}

/// A slab of 12 x 9 mm on z = 0 whose top is a grid of facets; `height` gives the height of each of its vertices.
template <class Height>
Triangles rough_slab(const Height& height) {
  constexpr int kColumns = 12, kRows = 9;
  const auto at = [](int i, int j, Nm z) { return Point3{1'000'000 * i + 500'007, 1'000'000 * j + 700'003, z}; };
  std::vector<Nm> top;
  for (int k = 0; k < (kColumns + 1) * (kRows + 1); ++k) top.push_back(height());
  const auto up = [&](int i, int j) { return at(i, j, top[static_cast<std::size_t>(j * (kColumns + 1) + i)]); };
  Triangles out;
  const auto quad = [&](Point3 a, Point3 b, Point3 c, Point3 d) { out.insert(out.end(), {{a, b, c}, {a, c, d}}); };
  for (int i = 0; i < kColumns; ++i) {
    for (int j = 0; j < kRows; ++j) {
      quad(up(i, j), up(i + 1, j), up(i + 1, j + 1), up(i, j + 1));
      quad(at(i, j, 0), at(i, j + 1, 0), at(i + 1, j + 1, 0), at(i + 1, j, 0));
    }
    quad(at(i, 0, 0), at(i + 1, 0, 0), up(i + 1, 0), up(i, 0));
    quad(at(i + 1, kRows, 0), at(i, kRows, 0), up(i, kRows), up(i + 1, kRows));
  }
  for (int j = 0; j < kRows; ++j) {
    quad(at(0, j + 1, 0), at(0, j, 0), up(0, j), up(0, j + 1));
    quad(at(kColumns, j, 0), at(kColumns, j + 1, 0), up(kColumns, j + 1), up(kColumns, j));
  }
  return out;
}

TEST(Engines, AHorizontalFaceWithNoiseIsInALayerOrIsNot) {
  const PixelGrid grid{{254, 14'000'000}, {254, 11'000'000}};
  constexpr Nm kPlane = 600'000;
  struct Case {
    Nm from, to;  // heights above the plane
    std::uint64_t pixels;
    bool reported;
  };
  for (const Case& one : {Case{-1000, 0, 0, false}, {-60, 100, 0, false}, {1, 100, 0, false}, {101, 900, 120 * 90, false},
                          {90, 110, 1, true}, {-1000, 1000, 1, true}, {-2500, 2500, 1, true}}) {
    std::mt19937 random(static_cast<unsigned>(one.to - one.from));
    std::uniform_int_distribution<Nm> pick(one.from, one.to);
    const Triangles slab = rough_slab([&] { return kPlane + pick(random); });
    const std::uint64_t pixels = expect_exact(slab, grid, {kPlane});
    Mesh mesh = make_mesh(slab);
    const std::vector<Instance> instances{{0, {0, 0, -kPlane}}, {0, {0, 0, 0}}};
    auto rasterizer = raster::Rasterizer::build({&mesh, 1}, instances, grid, FillRule::kNonzero, true, true);
    ASSERT_TRUE(rasterizer.ok());
    raster::LayerScratch scratch;
    Runs runs;
    const LevelFace face = rasterizer->layer(Engine::kContours, kPlane, scratch, runs).level;
    const LevelFace by_rays = rasterizer->layer(Engine::kRays, kPlane, scratch, runs).level;
    if (one.pixels != 1) {
      EXPECT_EQ(set_pixels(runs), one.pixels) << one.from << " to " << one.to << " nm";
    } else {
      EXPECT_GT(set_pixels(runs), 120u * 90 / 50) << "the face is whole or missing";
      EXPECT_LT(set_pixels(runs), 120u * 90 - 120 * 90 / 50) << "the face is whole or missing";
    }
    EXPECT_GE(pixels, set_pixels(runs));
    EXPECT_EQ(face.area_um2 > 0, one.reported);
    EXPECT_EQ(face.area_um2, by_rays.area_um2);
    if (!one.reported) continue;
    EXPECT_EQ(face.owner, 1u);
    EXPECT_LE(face.area_um2, 108'000'000u);
    EXPECT_EQ(face.plane, kPlane);
  }
}

TEST(Engines, AgreeAtTheFarEndOfTheReach) {
  // A bed of 2.1 m at low resolution: float holds these coordinates to 128 nm only.
  const PixelGrid grid{{120, 2'147'000'000}, {150, 2'147'000'000}};
  std::mt19937 random(7);
  const auto pick = [&] {
    return Point3{static_cast<Nm>(random() % 2'147'000'000), static_cast<Nm>(random() % 2'147'000'000),
                  static_cast<Nm>(random() % 2'147'000'000)};
  };
  EXPECT_GT(expect_exact(random_tetrahedra(12, pick), grid, {1, 700'000'001, 2'000'000'000}), 0u);
}

TEST(Engines, CopiesAreWhereTheirOffsetsSay) {
  const PixelGrid grid{{600, 60'000'000}, {300, 50'000'000}};
  std::mt19937 random(11);
  const auto pick = [&] {
    return Point3{static_cast<Nm>(random() % 9'000'000) - 4'000'000, static_cast<Nm>(random() % 9'000'000) - 4'000'000,
                  static_cast<Nm>(random() % 3'000'000) - 3'000'000};
  };
  std::vector<Point3> copies;
  for (int i = 0; i < 20; ++i) {
    copies.push_back({4'000'000 + static_cast<Nm>(random() % 50'000'000), 4'000'000 + static_cast<Nm>(random() % 40'000'000),
                      3'000'000 + static_cast<Nm>(random() % 2) * 1'000'000});
  }
  EXPECT_GT(expect_exact(random_tetrahedra(40, pick), grid, {500'000, 1'500'000, 3'300'001}, copies), 0u);
}

TEST(Engines, ManySmallFacetsThroughEveryClusterAndBand) {
  // A bumpy closed sheet of 2 x 100 x 100 cells, sorted along the curve because its list is shuffled.
  const PixelGrid grid{{1200, 22'000'000}, {1200, 22'000'000}};
  std::mt19937 random(5);
  constexpr int n = 100;
  std::vector<Point3> top;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i <= n; ++i) {
      top.push_back({1'000'000 + i * 200'000, 1'000'000 + j * 200'000, 1'000'000 + static_cast<Nm>(random() % 1'000'000)});
    }
  }
  Triangles part;
  const auto at = [&](int i, int j) { return top[static_cast<std::size_t>(j * (n + 1) + i)]; };
  const auto flat = [&](int i, int j) {
    Point3 p = at(i, j);
    p.z = 0;
    return p;
  };
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) {
      part.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      part.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      part.push_back({flat(i, j), flat(i + 1, j + 1), flat(i + 1, j)});
      part.push_back({flat(i, j), flat(i, j + 1), flat(i + 1, j + 1)});
    }
  }
  for (int i = 0; i < n; ++i) {
    const std::pair<std::pair<int, int>, std::pair<int, int>> walls[] = {
        {{i, 0}, {i + 1, 0}}, {{i + 1, n}, {i, n}}, {{0, i + 1}, {0, i}}, {{n, i}, {n, i + 1}}};
    for (const auto& [p, q] : walls) {
      part.push_back({flat(p.first, p.second), flat(q.first, q.second), at(q.first, q.second)});
      part.push_back({flat(p.first, p.second), at(q.first, q.second), at(p.first, p.second)});
    }
  }
  std::shuffle(part.begin(), part.end(), random);
  EXPECT_GT(expect_exact(part, grid, {0, 999'999, 1'000'000, 1'400'000, 1'900'000}), 0u);
}

TEST(Engines, AgreeWhereALayerHasSoManyCrossingsThatRaysTakeItInBands) {
  const PixelGrid grid{{1200, 22'000'000}, {2400, 22'000'000}};
  std::mt19937 random(23);
  const auto pick = [&] {
    const auto any = [&](unsigned maximum) { return static_cast<Nm>(random() % maximum); };
    return Point3{any(22'000'000), any(22'000'000), any(1'000'000)};
  };
  Mesh mesh = make_mesh(random_tetrahedra(1000, pick));
  const Instance instance{0, {0, 0, 0}};
  auto rasterizer = raster::Rasterizer::build({&mesh, 1}, {&instance, 1}, grid, FillRule::kPositive, true, true);
  raster::LayerScratch scratch;
  Runs rays, contours;
  const auto report = rasterizer->layer(Engine::kRays, 500'000, scratch, rays);
  EXPECT_GT(report.crossings, 1u << 19);
  EXPECT_GT(report.segments, rasterizer->layer(Engine::kContours, 500'000, scratch, contours).segments);  // cut again in each
  EXPECT_EQ(position_of_difference(rays, contours), "");
  EXPECT_GT(set_pixels(rays), 0u);
}

TEST(Scan, ARowThatStaysOpenEndsAtItsLastCrossingAndIsReported) {
  const PixelGrid grid{{254, 10'000'000}, {254, 8'000'000}};
  Triangles part = box({1'000'000, 1'000'000, 0}, {4'000'000, 3'000'000, 1'000'000});
  part.pop_back();  // half of the right wall
  Mesh mesh = make_mesh(part);
  mesh.closed = false;
  const Instance instance{0, {0, 0, 0}};
  auto rasterizer = raster::Rasterizer::build({&mesh, 1}, {&instance, 1}, grid, FillRule::kNonzero, true, true);
  raster::LayerScratch scratch;
  Runs rays, contours;
  const auto report = rasterizer->layer(Engine::kRays, 500'000, scratch, rays);
  rasterizer->layer(Engine::kContours, 500'000, scratch, contours);
  EXPECT_EQ(report.open_rows, 10u);
  EXPECT_EQ(position_of_difference(rays, contours), "");
  for (std::uint32_t r = 0; r < rays.view().rows(); ++r) {
    for (std::uint32_t column : rays.view().row(r)) EXPECT_LE(column, 40u);
  }
}

TEST(Scan, AnOpenPartEndsWhereItEndsRegardlessOfWhatIsNextToIt) {
  const PixelGrid grid{{254, 30'000'000}, {254, 8'000'000}};
  const Triangles whole = box({1'000'000, 1'000'000, 0}, {4'000'000, 3'000'000, 1'000'000});
  Triangles without_right = whole, without_left;
  std::erase_if(without_right, [](const Triangle& t) { return std::min({t.a.x, t.b.x, t.c.x}) == 4'000'000; });
  std::copy_if(whole.begin(), whole.end(), std::back_inserter(without_left), [](const Triangle& t) {
    return std::max({t.a.x, t.b.x, t.c.x}) != 1'000'000;
  });
  ASSERT_EQ(without_right.size() + 2, whole.size());
  ASSERT_EQ(without_left.size() + 2, whole.size());
  // The open ones add up to zero together, and a whole one stands behind each.
  std::vector<Mesh> meshes{make_mesh(without_right), make_mesh(without_left), make_mesh(whole)};
  meshes[0].closed = meshes[1].closed = false;
  const std::vector<Instance> instances{
      {0, {0, 0, 0}}, {2, {6'000'000, 0, 0}}, {1, {12'000'000, 0, 0}}, {2, {18'000'000, 0, 0}}};
  for (const FillRule rule : {FillRule::kNonzero, FillRule::kPositive, FillRule::kEvenOdd}) {
    std::vector<Mesh> copies = meshes;
    auto rasterizer = raster::Rasterizer::build(copies, instances, grid, rule, true, true);
    raster::LayerScratch scratch;
    Runs rays, contours;
    const auto report = rasterizer->layer(Engine::kRays, 500'000, scratch, rays);
    rasterizer->layer(Engine::kContours, 500'000, scratch, contours);
    EXPECT_EQ(report.open_rows, 20u);
    EXPECT_EQ(report.first_open_row, 10u);
    EXPECT_EQ(position_of_difference(rays, contours), "");
    for (std::uint32_t r = 0; r < rays.view().rows(); ++r) {
      const auto row = rays.view().row(r);
      if (row.empty()) continue;
      // Each open part has one wall only, and so no width; the whole ones are there.
      EXPECT_EQ(std::vector<std::uint32_t>(row.begin(), row.end()), (std::vector<std::uint32_t>{70, 100, 190, 220}));
    }
    EXPECT_EQ(set_pixels(rays), 2u * 30 * 20);
  }
}

TEST(Grid, TheFirstPixelAtOrBeyondAPointIsFoundByCounting) {
  for (double dpi : {1.0, 72.0, 254.0, 262.006, 540.43, 600.0, 1200.0, 25399.9999, 25400.0}) {
    const PixelAxis axis(pitch_of_dpi(dpi), 30'000'000);
    EXPECT_EQ(axis.dpi(), dpi);
    EXPECT_EQ(axis.span == kNmPerInch, dpi == std::floor(dpi));
    std::mt19937 random(static_cast<unsigned>(dpi));
    for (int i = 0; i < 200; ++i) {
      const std::int64_t nm = static_cast<std::int64_t>(random() % 30'000'000);
      const std::int64_t pixel = axis.first_at_or_beyond(nm);
      EXPECT_GE(axis.centre(pixel), nm);
      EXPECT_TRUE(pixel == 0 || axis.centre(pixel - 1) < nm);
      EXPECT_EQ(axis.first_at_or_beyond(axis.centre(pixel)), pixel);
    }
  }
}

}  // namespace
}  // namespace lamina::test
