// The layer lists that Lima (2009) printed.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <sstream>

#include "tests/heights/surfaces.h"

namespace lamina::heights {
namespace {

using test::set_of;

struct Row {
  double thickness, angle;  // mm, degrees; angle < 0: not printed
};

std::vector<Row> published(const std::string& name) {
  std::ifstream file(test::reference(name));
  EXPECT_TRUE(file) << name;
  std::vector<Row> rows;
  for (std::string line; std::getline(file, line);) {
    if (line.empty() || line[0] < '0' || line[0] > '9') continue;
    std::vector<std::string> cells;
    std::istringstream text(line);
    for (std::string cell; std::getline(text, cell, '\t');) cells.push_back(cell);
    rows.push_back({std::stod(cells.at(1)), cells.at(3).empty() ? -1 : std::stod(cells.at(3))});
  }
  return rows;
}

Options document() {
  Options options;
  options.mode = Mode::kAngle;
  options.set = set_of({0.178, 0.254});
  options.facets = Facets::kPlane;
  options.min_flat_mm2 = 0;
  return options;
}

void expect_published(const std::string& part, const std::string& list, Facets facets, bool angles) {
  Options options = document();
  options.facets = facets;
  const Result<Plan> plan = plan_heights(test::index_of_file(test::reference(part)), options);
  ASSERT_TRUE(plan.ok());
  const std::vector<Row> rows = published(list);
  ASSERT_EQ(plan->table.size(), rows.size()) << part;
  for (std::uint32_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(plan->table[i].thickness, test::nm(rows[i].thickness)) << part << ", layer " << i + 1;
    if (!angles || rows[i].angle < 0) continue;
    EXPECT_NEAR(angle_of(plan->inspected[i]), rows[i].angle, 0.00501) << part << ", layer " << i + 1;
  }
}

TEST(PublishedHeights, FirstCaseHasAllThicknessesAndAnglesOfAppendixB) {
  expect_published("case1_plane.stl", "expected_case1.tsv", Facets::kPlane, true);
}
TEST(PublishedHeights, SecondCaseHasItsThicknessesAndPrintedAngles) {
  expect_published("case2_plane.stl", "expected_case2.tsv", Facets::kPlane, true);
}
TEST(PublishedHeights, FourthCaseHasItsThicknessesAndPrintedAngles) {
  expect_published("case4_ramp.stl", "expected_case4.tsv", Facets::kPlane, true);
  expect_published("case4.stl", "expected_case4.tsv", Facets::kPlane, false);  // the printed slope is not in the staircase
}
TEST(PublishedHeights, FacetsWithinTheLayerGiveTheSameListsWhereSlopesEndBelowItsTop) {
  expect_published("case1_range.stl", "expected_case1.tsv", Facets::kRange, false);
  expect_published("case2_range.stl", "expected_case2.tsv", Facets::kRange, false);
  expect_published("case4.stl", "expected_case4.tsv", Facets::kRange, false);
}

TEST(PublishedHeights, ThreeThicknessesStopAtThePeakAndGoDownOnASlope) {
  const auto layers = [](double ledge, double top, std::initializer_list<double> set) {
    Options options = document();
    options.set = set_of(set);
    return test::thicknesses(
        plan_heights(test::index_of(test::strip({{0, 0}, {5, 0}, {5, ledge}, {3, ledge}, {3, top}, {0, top}, {0, 0}})), options)
            ->table);
  };
  using List = std::vector<double>;
  EXPECT_EQ(layers(1.0, 2.0, {0.254, 0.305, 0.356}), (List{0.356, 0.356, 0.254, 0.356, 0.356, 0.305}));
  EXPECT_EQ(layers(1.03, 2.0, {0.254, 0.305, 0.356}), (List{0.356, 0.356, 0.305, 0.356, 0.356, 0.254}));
  EXPECT_EQ(layers(1.016, 2.0, {0.178, 0.254}), (List{0.254, 0.254, 0.254, 0.178, 0.254, 0.254, 0.254, 0.254}));
  EXPECT_EQ(layers(0.3, 1.2, {0.178, 0.254}), (List{0.254, 0.254, 0.254, 0.254, 0.178}));
  // A slope asks for the least thickness at once, whatever lies between: the document calls that a limitation.
  Options options = document();
  options.set = set_of({0.1, 0.2, 0.3});
  const auto ramp = test::thicknesses(plan_heights(test::index_of(test::strip({{0, 0}, {4, 2}})), options)->table);
  EXPECT_EQ(ramp, List(20, 0.1));
}

TEST(PublishedHeights, EveryLayerHasOneReason) {
  const Result<Plan> plan = plan_heights(test::index_of_file(test::reference("case2_plane.stl")), document());
  for (const std::uint32_t peak : {11u, 30u, 34u, 40u}) EXPECT_EQ(plan->table[peak - 1].reason, LayerReason::kPeak) << peak;
  for (const std::uint32_t slope : {26u, 27u, 28u, 29u}) EXPECT_EQ(plan->table[slope - 1].reason, LayerReason::kSlope) << slope;
  EXPECT_EQ(plan->table[0].reason, LayerReason::kUniform);
}

TEST(PublishedHeights, OptimalHitsThePeaksThatTheRuleMisses) {
  // The rule leaves out a peak below which no further layer fits (case study 3, section 5.3).
  const SurfaceIndex index = test::index_of_file(test::reference("case2_plane.stl"));
  Options options = document();
  options.mode = Mode::kOptimal;
  options.set = test::range_of(0.178, 0.254, 0.001);
  options.cusp = 254'000;
  const Result<Plan> plan = plan_heights(index, options);
  const Evaluation evaluation = evaluate(index, boundaries_of(plan->table), options);
  EXPECT_EQ(evaluation.flats.size(), 5u);
  EXPECT_EQ(evaluation.flats_missed, 0u);
  EXPECT_EQ(evaluation.top_miss, 0);
  EXPECT_LE(plan->table.size(), 40u);
}

TEST(UniformHeights, LastLayerCountsEvenWherePartlyFilled) {
  for (const auto& [height, thickness, count] : {std::tuple{20.0, 0.254, 79u}, {25.4, 0.3, 85u}, {1.0, 0.1, 10u}}) {
    const LayerTable table = LayerTable::uniform(test::nm(height), test::nm(thickness));
    EXPECT_EQ(table.size(), count);
    EXPECT_EQ(table.top(), std::int64_t{count} * test::nm(thickness));
  }
}

}  // namespace
}  // namespace lamina::heights
