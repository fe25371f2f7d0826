// tests/infill/test_raster_positions.cpp: where straight lines lie: distances, groups, tables, formulas, staggers.
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "tests/infill/outlines.h"

namespace lamina::test {
namespace {

using infill::FillContext;
using infill::FillParameters;
using infill::Pattern;

TEST(RasterPositions, RasterLinesLieExactlyAtTheirDistance) {
  for (const auto& [angle, axis] : {std::pair<MicroDegrees, int>{0, 0}, {90'000'000, 1}, {180'000'000, 0}, {270'000'000, 1}}) {
    FillParameters parameters;
    parameters.angle_base = angle;
    parameters.gaps = {123'457};
    const Contours& square = outline("square");
    const Toolpaths paths = filled(square, context_of(square), parameters);
    std::map<std::int32_t, Nm> positions;
    for (std::size_t i = 0; i < paths.point.size(); ++i) {
      if (paths.kind[i] != PathKind::kRaster || paths.line[i] == kNoLine) continue;
      const Nm at = axis == 0 ? paths.point[i].y : paths.point[i].x;
      const auto [found, is_new] = positions.emplace(paths.line[i], at);
      EXPECT_EQ(found->second, at) << "a line is straight";
    }
    ASSERT_GT(positions.size(), 30u);
    for (auto it = std::next(positions.begin()); it != positions.end(); ++it) {
      EXPECT_EQ(std::abs(it->second - std::prev(it)->second), 523'457 * (it->first - std::prev(it)->first));
    }
    // 90 degrees: lines run along y and are counted towards -x, from the right side.
    EXPECT_EQ(positions.begin()->first, 0);
    const Nm first = axis == 0 ? positions[0] : 20 * kMm - positions[0];
    EXPECT_EQ(first, 200'000 + 523'457);
  }
}

TEST(RasterPositions, ZigzagAlternatesAndStaysOneToolpathOnASquare) {
  FillParameters parameters;
  parameters.angle_base = 0;
  const Contours& square = outline("square");
  const Toolpaths paths = filled(square, context_of(square), parameters);
  ASSERT_EQ(paths.size(), 2u) << "a wall, and a zigzag without a stop";
  EXPECT_EQ(paths.kind[0], PathKind::kOuter);
  EXPECT_TRUE(is_closed(paths, 0));
  for (std::uint32_t i = paths.offset[1]; i + 1 < paths.offset[2]; ++i) {
    if (paths.kind[i] != PathKind::kRaster) continue;
    EXPECT_EQ(paths.point[i + 1].x > paths.point[i].x, paths.line[i] % 2 == 0);
  }
}

TEST(RasterPositions, StaggerComesWithEveryReturnOfTheAngleAndBuildLayersKeepIt) {
  FillParameters parameters;
  parameters.angle_step = 60'000'000;
  parameters.build_layers = 2;
  parameters.stagger = {0, 100'000, 50'000};
  for (std::uint32_t layer = 0; layer < 40; ++layer) {
    EXPECT_EQ(infill::layer_angle(parameters, layer), (45'000'000 + layer / 2 * 60'000'000ll) % kTurn);
    EXPECT_EQ(infill::layer_stagger(parameters, layer), parameters.stagger[layer / 6 % 3]);
  }
  parameters.stagger_every_layer = true;
  for (std::uint32_t layer = 0; layer < 9; ++layer)
    EXPECT_EQ(infill::layer_stagger(parameters, layer), parameters.stagger[layer % 3]);
  // 45, 135, 225, 315 degrees: Lima 2009, Appendix B.
  parameters = FillParameters();
  for (std::uint32_t layer = 0; layer < 58; ++layer)
    EXPECT_EQ(infill::layer_angle(parameters, layer), 45'000'000 + layer % 4 * 90'000'000ll);
}

TEST(RasterPositions, GroupsAlternatingGapsAndDistancesAreAsDefined) {
  FillParameters parameters;
  parameters.group = 2;
  parameters.gaps = {600'000};
  auto distances = distances_of(positions_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) EXPECT_EQ(distances[i], i % 2 == 0 ? 400'000 : 1'000'000) << i;
  parameters.group = 1;
  parameters.gaps = {100'000, 700'000};
  distances = distances_of(positions_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) EXPECT_EQ(distances[i], i % 2 == 0 ? 500'000 : 1'100'000) << i;
  parameters.group = 3;
  distances = distances_of(positions_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) {
    EXPECT_EQ(distances[i], i % 3 != 2 ? 400'000 : i / 3 % 2 == 0 ? 500'000 : 1'100'000) << i;
  }
  parameters.distances = {430'000, 400'000, 430'000};  // S-C, C-C, C-S of Di Nisio 2022
  distances = distances_of(positions_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) EXPECT_EQ(distances[i], i % 3 == 1 ? 400'000 : 430'000) << i;
}

TEST(RasterPositions, StaggerMovesTheLinesOfTheLayer) {
  FillParameters parameters;
  parameters.gaps = {400'000};
  parameters.stagger = {0, 300'000};
  const auto even = positions_of(parameters, 0), odd = positions_of(parameters, 1), again = positions_of(parameters, 2);
  EXPECT_EQ(even, again);
  for (const Nm position : odd) EXPECT_EQ((position - even[0] - 300'000) % 800'000, 0);
  EXPECT_EQ(distances_of(odd)[3], 800'000);
}

TEST(RasterPositions, GapsFollowTheTableOfHeightsAndTheFormula) {
  FillParameters parameters;  // 750 -> 100 -> 750 micrometres: Sobral 2011, Grad 1
  parameters.gap_table = {{0, 750'000}, {10 * kMm, 100'000}, {20 * kMm, 750'000}};
  for (const std::uint32_t layer : {0u, 24u, 49u, 50u, 80u}) {
    const double z = layer * 200'000.0 + 100'000;
    const double gap = z < 10 * kMm ? 750'000 - z * 0.065 : 100'000 + (z - 10 * kMm) * 0.065;
    EXPECT_NEAR(distances_of(positions_of(parameters, layer))[0], 400'000 + gap, 1) << layer;
    FillParameters formula;
    formula.gap_expression = "z < 10 ? 0.75 - z * 0.065 : 0.1 + (z - 10) * 0.065";
    EXPECT_NEAR(distances_of(positions_of(formula, layer))[0], 400'000 + gap, 1) << layer;
  }
  FillParameters across;
  across.gap_expression = "0.2 + 0.8 * u";
  const auto positions = positions_of(across);
  for (std::size_t i = 1; i < positions.size(); ++i) {
    const double gap = 0.2 + 0.8 * positions[i - 1] / (20.0 * kMm);
    EXPECT_NEAR(positions[i] - positions[i - 1], 400'000 + gap * 1e6, 1) << i;
  }
}

/// Di Nisio 2022, sections 3.2.2 and 3.2.3: blocks 62 and 48 mm wide, bead 0.4, one contour, a gap of 2 mm: 24 and 18
/// lines, of which every other one, 12 and 9, is segmented.
TEST(RasterPositions, DocumentsTestLayoutsHaveTwelveAndNineSegmentedLines) {
  for (const auto& [wide, lines] : {std::pair{62.0, 24u}, {48.0, 18u}}) {
    const Contours block = contours_of({{{0, 0}, {wide, 0}, {wide, 50}, {0, 50}}});
    FillParameters parameters;
    parameters.gaps = {2 * kMm};
    parameters.angle_base = 90'000'000;
    parameters.angle_step = 0;
    const Toolpaths paths = filled(block, context_of(block), parameters);
    std::set<std::int32_t> numbers;
    std::set<Nm> positions;
    std::uint32_t segmented = 0;
    for (std::size_t i = 0; i < paths.point.size(); ++i) {
      if (paths.line[i] == kNoLine) continue;
      if (numbers.insert(paths.line[i]).second && paths.line[i] % 2 != 0) ++segmented;
      positions.insert(paths.point[i].x);
    }
    EXPECT_EQ(numbers.size(), lines);
    EXPECT_EQ(segmented, lines / 2);
    EXPECT_EQ(*positions.rbegin(), static_cast<Nm>(wide * kMm) - 2'600'000) << "one distance from the wall's centre";
  }
}

}  // namespace
}  // namespace lamina::test
