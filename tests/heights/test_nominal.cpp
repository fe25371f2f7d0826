// Parts that are stretched to make up for shrinkage: angles are nominal, heights are those of the placed part; and what is
// done at the top, and with small peaks.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "pipeline/report/heights_study.h"
#include "tests/heights/surfaces.h"

namespace lamina::heights {
namespace {

using test::nm;
using test::set_of;
using Profile = std::vector<std::pair<double, double>>;

constexpr ScaleFactors kLima{1.007, 1.007, 1};

/// A strip stretched in x and z about the origin, as it is loaded with --shrink.
SurfaceIndex scaled(Profile profile, const ScaleFactors& by, const SurfaceOptions& options = {}) {
  for (auto& [x, z] : profile) x *= by[0], z *= by[2];
  const Instance instance{0, {0, 0, 0}};
  const std::uint32_t part = 0;
  return index_surface(test::kept({test::strip(profile)}), std::span(&instance, 1), std::span(&part, 1), 1, options,
                       std::span(&by, 1));
}

Options by_angle(std::initializer_list<double> set) {
  Options options;
  options.mode = Mode::kAngle;
  options.set = set_of(set);
  return options;
}

/// A slope whose normal rises by this angle, 5 mm high.
Profile wedge(double degrees) { return {{0, 0}, {5 * std::tan(degrees * std::numbers::pi / 180), 5}}; }

TEST(NominalSlopes, AWedgeJustBelowTheLimitKeepsItsThickLayersWhenItIsScaled) {
  const Options options = by_angle({0.178, 0.254});
  for (const ScaleFactors& by : {ScaleFactors{1, 1, 1}, kLima}) {
    const Result<Plan> plan = plan_heights(scaled(wedge(44.85), by), options);
    ASSERT_TRUE(plan.ok());
    EXPECT_EQ(plan->table.size(), 19u);  // 5 mm / 0.254; as printed the slope is 45.05 degrees: 28 layers of 0.178
    for (const Steepness slope : plan->inspected) EXPECT_NEAR(angle_of(slope), 44.85, 1e-4);
  }
  EXPECT_EQ(plan_heights(scaled(wedge(45.05), kLima), options)->table.size(), 28u);
}

TEST(NominalSlopes, HeightsAndFlatsAreThoseOfThePlacedPart) {
  const ScaleFactors by{1, 1, 1.02};
  const SurfaceIndex index = scaled({{0, 0}, {5, 0}, {5, 1}, {3, 1}, {3, 2}, {0, 2}}, by);
  EXPECT_EQ(index.top, nm(2.04));
  const std::vector<Flat> flats = find_flats(index, 1000, 1);
  ASSERT_EQ(flats.size(), 2u);
  EXPECT_EQ(flats[0].height, nm(1.02));
  EXPECT_NEAR(flats[0].up_mm2, 20, 1e-9);
  // A face is as horizontal as it was before: sin 60 degrees is 0.866, the slopes are 0.861 (0.881 as printed) and 0.873
  // (0.849).
  SurfaceOptions options;
  options.peak_angle_deg = 60;
  options.flat_tolerance = nm(0.5);
  EXPECT_TRUE(scaled({{0, 0}, {0.5, 0.295}}, {1.1, 1, 1}, options).meshes[0].flats.empty());
  EXPECT_FALSE(scaled({{0, 0}, {0.5, 0.28}}, {0.9, 1, 1}, options).meshes[0].flats.empty());
}

TEST(NominalSlopes, StepsAreThoseThatArePrintedOrThoseThatAreLeft) {
  const ScaleFactors by{1.1, 1, 1.25};
  const Profile profile{{0, 0}, {3, 4}};
  const std::int64_t boundaries[] = {0, nm(1), nm(3), nm(5)};
  Options options = by_angle({0.1});
  // Printed: 3.3 in x, 5 in z. Nominal: a layer of 1 mm is 0.8 mm high on the part that has shrunk, a slope of 3 to 4.
  const double printed = 3.3 / std::hypot(3.3, 5), nominal = 0.6 / 1.25;
  for (const bool of_nominal : {false, true}) {
    options.surface.nominal_cusps = of_nominal;
    const SurfaceIndex index = scaled(profile, by, options.surface);
    const Evaluation found = evaluate(index, boundaries, options);
    const double step = of_nominal ? nominal : printed;
    EXPECT_NEAR(static_cast<double>(found.layers[0].cusp), 1e6 * step, 1);
    EXPECT_NEAR(static_cast<double>(found.largest_cusp), 2e6 * step, 1);
    EXPECT_NEAR(found.mean_cusp, 1.8e6 * step, 1) << "of equal slopes 1 mm, 2 mm and 2 mm high";
    EXPECT_NEAR(angle_of(found.layers[0].flattest), std::asin(0.6) * 180 / std::numbers::pi, 1e-4);
    EXPECT_NEAR(index.area_mm2, of_nominal ? 50 : 10 * std::hypot(3.3, 5), 1e-6);
  }
  // The limit is kept by the steps that were asked for.
  options.mode = Mode::kCusp;
  options.set = test::range_of(0.05, 0.5, 0.001);
  for (const bool of_nominal : {false, true}) {
    options.surface.nominal_cusps = of_nominal;
    const SurfaceIndex index = scaled(profile, by, options.surface);
    const Result<Plan> plan = plan_heights(index, options);
    EXPECT_EQ(plan->table[0].thickness, nm(std::floor(0.1 / (of_nominal ? nominal : printed) * 1000) / 1000));
  }
}

TEST(NominalSlopes, AppendixBOfAPartThatIsScaledByItsFactors) {
  // The document's job had the factors 1.007, 1.007 and 1; 30.00 degrees printed there are those of the STL file.
  load::LoadOptions load;
  load.transform = load::make_transform({1, 1, 1}, {0, 0, 0}, kLima);
  Result<Part> part = load::load(test::reference("case1_plane.stl"), load);
  ASSERT_TRUE(part.ok());
  const Result<Part> plain = load::load(test::reference("case1_plane.stl"), {});
  ASSERT_TRUE(plain.ok());
  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) instance.offset.z -= part->bounds.lo.z;
  const std::vector<std::uint32_t> parts(instances.size(), 0);
  const std::vector<ScaleFactors> by(part->meshes.size(), kLima);
  Options options = by_angle({0.178, 0.254});
  options.facets = Facets::kPlane;
  const SurfaceIndex index = index_surface(part->meshes, instances, parts, 1, options.surface, by);
  const Result<Plan> found = plan_heights(index, options);
  const Result<Plan> expected = plan_heights(test::index_of_file(test::reference("case1_plane.stl")), options);
  ASSERT_EQ(found->table.size(), 58u);
  for (std::uint32_t i = 0; i < 58; ++i) {
    EXPECT_EQ(found->table[i].thickness, expected->table[i].thickness) << i;
    EXPECT_NEAR(angle_of(found->inspected[i]), angle_of(expected->inspected[i]), 2e-4) << i;
  }
}

/// The layers reach the top, the last one is sampled within the part, and slopes get the least thickness as before.
void expect_covered(const SurfaceIndex& index, const Options& options) {
  Options covering = options;
  covering.cover_top = true;
  const Result<Plan> plain = plan_heights(index, options), covered = plan_heights(index, covering);
  EXPECT_LT(plain->table.top() + options.surface.flat_tolerance, index.top);
  EXPECT_GE(covered->table.top() + options.surface.flat_tolerance, index.top);
  EXPECT_LT(covered->table.top() - index.top, options.set.maximum());
  EXPECT_LT(covered->table[covered->table.size() - 1].plane(), index.top);
  if (options.mode != Mode::kAngle) return;
  ASSERT_EQ(covered->inspected.size(), covered->table.size());
  for (std::uint32_t i = 0; i + 1 < plain->table.size(); ++i) EXPECT_EQ(covered->table[i].thickness, plain->table[i].thickness);
}

TEST(CoverTop, LayersOnFlatSlopesKeepTheMinThickness) {
  Options covering = by_angle({0.178, 0.254});
  covering.cover_top = true;
  int covered = 0;
  for (int i = 0; i < 40; ++i) {
    const double height = 3 + 0.01 * i;
    const SurfaceIndex index =
        test::index_of(test::strip({{0, 0}, {5, 0}, {5, height - 0.6}, {3, height}, {0, height}, {0, 0}}));
    const Result<Plan> plan = plan_heights(index, covering);
    EXPECT_GE(plan->table.top() + covering.surface.flat_tolerance, index.top);
    covered += plan->table.top() > index.top ? 1 : 0;
    for (std::uint32_t k = 0; k < plan->table.size(); ++k) {
      if (angle_of(plan->inspected[k]) < 45) continue;
      EXPECT_EQ(plan->table[k].thickness, 178'000) << height << " mm, layer " << k;
    }
  }
  EXPECT_GT(covered, 30);
}

TEST(CoverTop, WhatIsLeftBelowTheTopIsBuilt) {
  const auto box = [](double height) {
    return test::index_of(test::strip({{0, 0}, {5, 0}, {5, height}, {0, height}, {0, 0}}));
  };
  // 19 layers of 0.254 end 66 um below the top: two of 0.178 in place of the last one end 36 um above it.
  const SurfaceIndex low = box(19 * 0.254 + 0.066);
  expect_covered(low, by_angle({0.178, 0.254}));
  Options covering = by_angle({0.178, 0.254});
  covering.cover_top = true;
  const Result<Plan> plan = plan_heights(low, covering);
  EXPECT_EQ(plan->table.size(), 20u);
  EXPECT_EQ(plan->table.top() - low.top, nm(0.036));
  EXPECT_EQ(plan->table[19].reason, LayerReason::kFlat);
  // 0.5 mm below the top.
  expect_covered(box(3.7), by_angle({0.6, 0.8}));
  Options optimal = by_angle({1, 1.5});
  optimal.mode = Mode::kOptimal;
  optimal.cusp = nm(2);
  expect_covered(box(3.2), optimal);  // 3.0 is nearer than 3.5
  // A top on which a thick layer ends gets a thin one by the rule, that leaves 0.076 mm; and what lies within the tolerance.
  for (const double height : {10 * 0.254, 10 * 0.254 + 0.0009}) {
    const Result<Plan> exact = plan_heights(box(height), covering);
    EXPECT_EQ(test::thicknesses(exact->table), std::vector<double>(10, 0.254)) << height;
  }
}

TEST(CoverTop, AFaceAtTheEndOfTheLastLayerStaysItsEnd) {
  // A ledge 0.066 mm below the top, on which the 19th layer ends, of 0.178 mm; one of 0.254 in its place would cover the part.
  const double ledge = 18 * 0.254 + 0.178, top = ledge + 0.066;
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {5, 0}, {5, ledge}, {3, ledge}, {3, top}, {0, top}}));
  Options options = by_angle({0.178, 0.254});
  options.cover_top = true;
  const Result<Plan> plan = plan_heights(index, options);
  const std::vector<std::int64_t> boundaries = boundaries_of(plan->table);
  EXPECT_EQ(distance_to_nearest(boundaries, nm(ledge)), 0);
  EXPECT_GE(plan->table.top(), nm(top));
}

TEST(CoverTop, SlopesAtTheTopKeepTheMinThickness) {
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {20, 1.0}}));  // 87 degrees
  Options options = by_angle({0.178, 0.254});
  options.cover_top = true;
  const Result<Plan> plan = plan_heights(index, options);
  EXPECT_EQ(test::thicknesses(plan->table), std::vector<double>(6, 0.178));
}

TEST(SmallPeaks, AreNoPeaksUnlessEveryFacetIs) {
  // A ledge of 0.5 mm2 at 0.432 mm, on a part for four layers of 0.254.
  const SurfaceIndex index = test::index_of(test::strip({{0, 0}, {5, 0}, {5, 0.432}, {4.95, 0.432}, {4.95, 1.02}, {0, 1.02}}));
  Options options = by_angle({0.178, 0.254});
  const Result<Plan> plain = plan_heights(index, options);
  EXPECT_EQ(test::thicknesses(plain->table), std::vector<double>(4, 0.254));
  EXPECT_EQ(plain->small_peaks, 1u);
  EXPECT_NE(pipeline::small_peaks_text(*plain, 1).find("--peaks facets"), std::string::npos);
  options.peaks = Peaks::kFacets;
  const Result<Plan> document = plan_heights(index, options);
  EXPECT_EQ(test::thicknesses(document->table), (std::vector<double>{0.254, 0.178, 0.254, 0.254}));
  EXPECT_EQ(document->small_peaks, 0u);
  EXPECT_EQ(pipeline::small_peaks_text(*document, 1), "");
}

}  // namespace
}  // namespace lamina::heights
