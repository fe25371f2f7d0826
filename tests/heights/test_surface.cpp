// What heights are decided from, against facet-by-facet answers; and what is made of it besides tables.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>
#include <random>
#include <sstream>

#include "stages/formats/rp3/rp3.h"
#include "stages/geometry/blocks/block_maker.h"
#include "stages/heights/candidate_heights.h"
#include "stages/heights/heights.h"
#include "tests/heights/surfaces.h"

namespace lamina::heights {
namespace {

using test::set_of;

Mesh random_mesh(unsigned seed, int facets) {
  std::mt19937 random(seed);
  const auto pick = [&](Nm high) { return static_cast<Nm>(random() % static_cast<unsigned>(high)); };
  Mesh mesh;
  for (int i = 0; i < facets; ++i) {
    // Small ones and ones as tall as the part; some vertical, some level.
    const Nm z = pick(3'000'000), rise = i % 7 == 0 ? 3'000'000 - z : pick(200'000) + 1;
    const Point3 a{pick(1'000'000), pick(1'000'000), z};
    Point3 b{pick(1'000'000), pick(1'000'000), z + pick(rise) + 0}, c{pick(1'000'000), pick(1'000'000), z + rise};
    if (i % 5 == 0) b = {a.x, a.y, a.z + rise / 2};
    if (i % 11 == 0) b.z = c.z = a.z;
    mesh.triangles.push_back({a, b, c});
  }
  mesh.triangles.push_back({{0, 0, 0}, {0, 1'000'000, 0}, {0, 0, 3'000'000}});
  for (const Triangle& t : mesh.triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
  }
  return mesh;
}

TEST(HeightSurface, EveryLayerSeesExactlyTheFacetsThatReachIntoIt) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const Mesh mesh = random_mesh(seed, 400);
    const SurfaceIndex index = test::index_of(mesh);
    std::mt19937 random(seed);
    std::vector<std::int64_t> boundaries{0};
    while (boundaries.back() < index.top) boundaries.push_back(boundaries.back() + 20'000 + random() % 300'000);
    Options options;
    options.set = set_of({0.1});
    const Evaluation evaluation = evaluate(index, boundaries, options);
    double steps = 0, area = 0;
    std::vector<double> flattest(boundaries.size() - 1, 0.0);
    for (const Triangle& t : mesh.triangles) {
      const double ux = t.b.x - t.a.x, uy = t.b.y - t.a.y, uz = t.b.z - t.a.z;
      const double vx = t.c.x - t.a.x, vy = t.c.y - t.a.y, vz = t.c.z - t.a.z;
      const double nx = uy * vz - uz * vy, ny = uz * vx - ux * vz, nz = ux * vy - uy * vx;
      const double length = std::sqrt(nx * nx + ny * ny + nz * nz);
      const Nm lo = std::min({t.a.z, t.b.z, t.c.z}), hi = std::max({t.a.z, t.b.z, t.c.z});
      if (length == 0 || (hi - lo <= options.surface.flat_tolerance && std::abs(nz) >= 0.999 * length)) continue;
      area += length / 2;
      for (std::size_t i = 0; i + 1 < boundaries.size(); ++i) {
        const double shared =
            static_cast<double>(std::min<std::int64_t>(hi, boundaries[i + 1]) - std::max<std::int64_t>(lo, boundaries[i]));
        if (shared <= 0) continue;
        flattest[i] = std::max(flattest[i], std::abs(nz) / length);
        steps += static_cast<double>(boundaries[i + 1] - boundaries[i]) * std::abs(nz) / 2 * shared / (double(hi) - lo);
      }
    }
    for (std::size_t i = 0; i + 1 < boundaries.size(); ++i) {
      EXPECT_NEAR(evaluation.layers[i].flattest, flattest[i] * kHorizontal, 1.5) << "layer " << i;
    }
    EXPECT_NEAR(evaluation.mean_cusp, steps / area, 1e-6 * evaluation.mean_cusp);
  }
}

TEST(HeightSurface, PlanesCutWhatBeginsBelowThemAndReachesThem) {
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {0.5, 1}, {0.5, 2}, {3, 3}}));
  const Result<CandidateHeights> candidate_heights = CandidateHeights::reachable(set_of({0.5}), 3'000'000);
  const Buffer<Steepness> at = steepest_at_candidates(index, index.parts, *candidate_heights);
  const double low = 0.5 / std::hypot(0.5, 1.0), high = 2.5 / std::hypot(2.5, 1.0);
  const double expected[] = {0, low, low, 0, 0, high, high};
  for (std::size_t candidate = 0; candidate < 7; ++candidate)
    EXPECT_NEAR(at[candidate], expected[candidate] * kHorizontal, 1.5) << candidate;
}

TEST(HeightSurface, AnglesComeFromTheCornersAndDownwardFacesCountAsUpwardOnes) {
  for (const double degrees : {0.5, 15.01, 45.0, 82.12, 89.5}) {
    const double run = std::tan(degrees * std::numbers::pi / 180);
    for (const double side : {-1.0, 1.0}) {
      const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {side * run * 2, 2}}));
      Options options;
      options.set = set_of({0.1});
      const std::int64_t boundaries[] = {0, 1'000'000, 2'000'000};
      EXPECT_NEAR(angle_of(evaluate(index, boundaries, options).layers[1].flattest), degrees, 1e-4);
    }
  }
}

TEST(HeightSurface, SmallFacetsRequestNothing) {
  Mesh mesh = test::strip({{0, 0}, {0, 3}});
  mesh.triangles.push_back({{0, 0, 1'000'000}, {100'000, 0, 1'010'000}, {0, 100'000, 1'000'000}});  // 0.005 mm2, nearly level
  Options options;
  options.mode = Mode::kCusp;
  options.set = set_of({0.1, 0.3});
  const auto layers = [&](double minimum) {
    SurfaceOptions surface;
    surface.min_facet_mm2 = minimum;
    return plan_heights(test::index_of(mesh, surface), options)->table.size();
  };
  EXPECT_GT(layers(0), 10u);
  EXPECT_EQ(layers(0.01), 10u);
}

TEST(HeightSurface, PartThatIsThinnerThanTheMinThicknessIsOneLayer) {
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {1, 0}, {1, 0.05}, {0, 0.05}}));
  for (const Mode mode : {Mode::kUniform, Mode::kAngle, Mode::kCusp, Mode::kStepwise, Mode::kOptimal}) {
    Options options;
    options.mode = mode;
    options.set = mode == Mode::kUniform ? set_of({0.2}) : set_of({0.2, 0.3});
    const Result<Plan> plan = plan_heights(index, options);
    ASSERT_TRUE(plan.ok());
    EXPECT_EQ(plan->table.size(), 1u) << int(mode);
    EXPECT_GE(plan->table.top(), 200'000) << int(mode);
  }
}

TEST(PerPartHeights, EachPartHasItsOwnLayersWithinCommonSlabs) {
  // A wall and a slope of the same height next to each other.
  const Mesh meshes[] = {test::strip({{0, 0}, {0, 6.03}}), test::strip({{0, 0}, {20, 5}})};
  const Instance instances[] = {{0, {0, 0, 0}}, {1, {30'000'000, 0, 0}}};
  const std::uint32_t parts[] = {0, 1};
  Options options;
  options.mode = Mode::kOptimal;
  options.set = test::range_of(0.05, 0.3, 0.001);
  const SurfaceIndex index = index_surface(meshes, instances, parts, 2, options.surface);
  const Result<Plan> common = plan_heights(index, options);
  const Result<PerPartPlan> own = plan_per_part(index, options);
  ASSERT_TRUE(own.ok());
  EXPECT_EQ(own->slab, 300'000);
  EXPECT_EQ(own->parts[0].table.size(), 21u);  // 20 slabs and the last 0.03 within reach of two layers
  EXPECT_GE(own->parts[1].table.size(), 50u);  // 0.1 mm of step at most
  EXPECT_LT(own->parts[0].table.size() + own->parts[1].table.size(), 2 * common->table.size());
  for (const Plan& plan : own->parts) {
    const std::vector<std::int64_t> boundaries = boundaries_of(plan.table);
    for (std::int64_t slab = 0; slab + own->slab < plan.table.top(); slab += own->slab) {
      EXPECT_EQ(distance_to_nearest(boundaries, slab), 0) << mm(slab);
    }
  }
  EXPECT_EQ(slab_height(set_of({0.178, 0.254})), 22'606'000);
}

TEST(Rp3, RowsOfTheFirstCaseAreThoseOfAppendixB) {
  Options options;
  options.mode = Mode::kAngle;
  options.set = set_of({0.178, 0.254});
  options.facets = Facets::kPlane;
  const Result<Plan> plan = plan_heights(test::index_of_file(test::reference("case1_plane.stl")), options);
  std::vector<formats::rp3::LayerSetting> layers;
  for (std::uint32_t i = 0; i < plan->table.size(); ++i) {
    layers.push_back({mm(plan->table[i].thickness), angle_of(plan->inspected[i])});
  }
  formats::rp3::Settings settings;
  settings.shrink = {1.007, 1.007, 1};
  const std::string text = formats::rp3::text_of(layers, settings);
  // The printed file: its head, its summary, its rows; but for -0.00, which the document prints for walls.
  std::ifstream rows(test::reference("appendix_b.rp3.tsv")), head(test::reference("appendix_b.header.txt"));
  std::string expected, line;
  while (std::getline(head, line)) {
    if (line.starts_with("(")) {
      for (std::string row; std::getline(rows, row);) {
        if (!row.empty() && row[0] >= '0' && row[0] <= '9') expected += row + "\n";
      }
    } else {
      expected += line + "\n";
    }
  }
  for (std::size_t at = 0; (at = expected.find("-0.00", at)) != std::string::npos;) expected.erase(at, 1);
  EXPECT_EQ(text, expected);
}

TEST(Thicknesses, SetsAndRangesAreReadStrictly) {
  const auto read = [](std::string_view text) {
    const auto set = read_thicknesses(text);
    return set ? set->values : std::vector<Nm>{};
  };
  EXPECT_EQ(read("0.254,0.178"), (std::vector<Nm>{178'000, 254'000}));
  EXPECT_EQ(read("0.05..0.2:0.05"), (std::vector<Nm>{50'000, 100'000, 150'000, 200'000}));
  EXPECT_EQ(read("0.05..0.3").size(), 251u);
  EXPECT_EQ(read("0.05..0.05:0.1"), std::vector<Nm>{50'000});
  EXPECT_EQ(read("0.1"), (std::vector<Nm>{100'000}));
  for (const char* wrong :
       {"", ",", "0.1,", "0.1,0.1", "-0.1,0.2", "0", "nan", "0.3..0.1", "0.1..", "..0.3", "0.1..0.3:0", "0.1..0.3:-1",
        "0.1..0.3:x", "0.05..0.3:0.1", "0.05..0.12:0.05", "0.0254..0.3", "0.001..1000:0.000001", "0.1...0.3"}) {
    EXPECT_TRUE(read(wrong).empty()) << wrong;
  }
}

TEST(Steepest, ManyFacetsInSharesGiveWhatEachFacetRequests) {
  std::mt19937 random(11);
  Mesh mesh;
  for (int i = 0; i < 40'000; ++i) {
    const Nm z = static_cast<Nm>(random() % 1'500'000), rise = static_cast<Nm>(1 + random() % (i % 100 == 0 ? 400'000 : 9000));
    const Nm out = static_cast<Nm>(1 + random() % 30'000);
    mesh.triangles.push_back({{0, 0, z}, {0, 1'000'000, z}, {out, 0, z + rise}});
  }
  for (const Triangle& t : mesh.triangles) {
    for (const Point3& p : {t.a, t.b, t.c}) mesh.bounds.add(p);
  }
  const SurfaceIndex index = test::index_of(mesh);
  const Result<CandidateHeights> candidate_heights = CandidateHeights::reachable(test::set_of({0.05, 0.06}), index.top);
  ASSERT_TRUE(candidate_heights.ok());
  ASSERT_GT(worthwhile_shares(index, index.parts, 8 * candidate_heights->candidates()), 1u);
  Buffer<Steepness> cells(candidate_heights->cells(), 0), candidates(candidate_heights->candidates(), 0);
  std::vector<double> below(candidate_heights->candidates(), 0);
  for_each_slope(index, index.parts[0], 0, 1, [&](Nm lo, Nm hi, Steepness steepness, double projected) {
    for (std::uint32_t i = 0; i < candidate_heights->candidates(); ++i) {
      const std::int64_t bottom = (*candidate_heights)[i];
      if (i < candidate_heights->cells() && lo < (*candidate_heights)[i + 1] && hi > bottom)
        cells[i] = std::max(cells[i], steepness);
      if (lo < bottom && hi >= bottom) candidates[i] = std::max(candidates[i], steepness);
      const double share = std::clamp((static_cast<double>(bottom) - lo) / (static_cast<double>(hi) - lo), 0.0, 1.0);
      below[i] += std::abs(projected) * share;
    }
  });
  EXPECT_EQ(steepest_in_cells(index, index.parts, *candidate_heights), cells);
  EXPECT_EQ(steepest_at_candidates(index, index.parts, *candidate_heights), candidates);
  const Buffer<double> found = projected_below(index, index.parts, *candidate_heights, Sign::kBoth);
  for (std::uint32_t i = 0; i < candidate_heights->candidates(); ++i)
    EXPECT_NEAR(found[i], below[i], 1e-9 * (1 + below[i])) << i;
}

/// Sums too: facets are read in the order of the file.
TEST(HeightSurface, BlocksAreAsTheListThatTheyAreMadeOf) {
  const Mesh list = random_mesh(3, 50'000);
  Mesh blocks;
  blocks.bounds = list.bounds;
  blocks.blocks = std::make_shared<MeshBlocks>(static_cast<std::uint32_t>(list.triangles.size()), 0, true);
  BlockMaker maker;
  for (std::uint32_t b = 0; b < blocks.blocks->block_count(); ++b) {
    const auto facets = std::span(list.triangles).subspan(blocks.blocks->first_triangle(b), blocks.blocks->triangles_in(b));
    maker.make(facets, *blocks.blocks, b);
  }
  const Instance instance{0, {0, 0, 0}};
  const std::uint32_t part = 0;
  const Result<CandidateHeights> heights = CandidateHeights::reachable(set_of({0.05, 0.06}), list.bounds.hi.z);
  for (const ScaleFactors& scale : {ScaleFactors{1, 1, 1}, ScaleFactors{1.01, 1.02, 1.05}}) {
    SurfaceOptions options;
    options.nominal_cusps = true;
    const auto index_of = [&](const Mesh& mesh) {
      return index_surface(std::span(&mesh, 1), std::span(&instance, 1), std::span(&part, 1), 1, options, std::span(&scale, 1));
    };
    const SurfaceIndex one = index_of(list), other = index_of(blocks);
    ASSERT_TRUE(other.meshes[0].steepness.empty());
    EXPECT_EQ(one.area_mm2, other.area_mm2);
    EXPECT_EQ(one.meshes[0].flats.size(), other.meshes[0].flats.size());
    for (const Slope slope : {Slope::kSteps, Slope::kAngles})
      EXPECT_EQ(steepest_in_cells(one, one.parts, *heights, slope), steepest_in_cells(other, other.parts, *heights, slope));
    EXPECT_EQ(projected_below(one, one.parts, *heights, Sign::kBoth),
              projected_below(other, other.parts, *heights, Sign::kBoth));
    EXPECT_EQ(section_at_candidates(one, *heights, 1000), section_at_candidates(other, *heights, 1000));
  }
}

}  // namespace
}  // namespace lamina::heights
