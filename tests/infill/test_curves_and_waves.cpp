// tests/infill/test_curves_and_waves.cpp: closed curves and waves take their places from the same list as lines.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "stages/infill/layout.h"
#include "stages/infill/lines.h"
#include "tests/infill/outlines.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using infill::FillContext;
using infill::FillParameters;
using infill::Pattern;

/// Depths of the closed curves in the square, nm from its side.
std::vector<Nm> depths_of(FillParameters parameters, std::uint32_t layer = 0) {
  if (parameters.pattern != Pattern::kContourRaster) parameters.pattern = Pattern::kContour;
  const Contours& square = outline("square");
  const Toolpaths paths = filled(square, context_of(square, layer), parameters);
  std::vector<Nm> depths;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    if (paths.kind[paths.offset[p]] != PathKind::kContour) continue;
    Nm lowest = INT32_MAX;
    for (const Point2 at : paths.view()[p]) lowest = std::min(lowest, at.x);
    depths.push_back(lowest);
  }
  return depths;
}

/// Troughs of the waves that lie in the square as a whole, by line.
std::map<std::int32_t, Nm> troughs_of(FillParameters parameters, std::uint32_t layer = 0) {
  parameters.angle_base = parameters.angle_step = 0;
  const Contours& square = outline("square");
  const Toolpaths paths = filled(square, context_of(square, layer), parameters);
  std::map<std::int32_t, std::pair<Nm, Nm>> reach;
  for (std::size_t i = 0; i < paths.point.size(); ++i) {
    if (paths.line[i] == kNoLine) continue;
    auto& [low, high] = reach.try_emplace(paths.line[i], INT32_MAX, INT32_MIN).first->second;
    low = std::min(low, paths.point[i].y);
    high = std::max(high, paths.point[i].y);
  }
  std::map<std::int32_t, Nm> troughs;
  for (const auto& [line, ends] : reach) {
    if (ends.second - ends.first == infill::wave_height(parameters)) troughs[line] = ends.first;
  }
  return troughs;
}

/// Groups, gaps in turn, centre distances, tables, formulas and staggers of any kind mean the same for all patterns.
TEST(CurvesAndWaves, OneListOfDistancesPositionsLinesWavesAndCurves) {
  std::mt19937 random(4);
  const auto pick = [&](Nm low, Nm high) { return std::uniform_int_distribution<Nm>(low, high)(random); };
  for (int turn = 0; turn < 60; ++turn) {
    FillParameters parameters;
    parameters.group = static_cast<std::uint32_t>(pick(1, 4));
    parameters.gaps.clear();
    for (Nm k = pick(1, 3); k > 0; --k) parameters.gaps.push_back(pick(-150'000, 700'000));
    if (turn % 5 == 1) parameters.gap_table = {{0, pick(0, 700'000)}, {10 * kMm, pick(0, 700'000)}};
    if (turn % 5 == 2) parameters.gap_expression = "0.3 + 0.2 * sin(i) + 0.01 * n - 0.02 * z";
    if (turn % 5 == 3) parameters.distances = {pick(100'000, 900'000), pick(100'000, 900'000), pick(100'000, 900'000)};
    const auto layer = static_cast<std::uint32_t>(pick(0, 40));
    const auto of_lines = distances_of(positions_of(parameters, layer)), of_curves = distances_of(depths_of(parameters, layer));
    ASSERT_GT(of_curves.size(), 5u);
    ASSERT_GE(of_lines.size(), of_curves.size());
    for (std::size_t i = 0; i < of_curves.size(); ++i)
      ASSERT_EQ(of_curves[i], of_lines[i]) << "turn " << turn << ", curve " << i;
    parameters.pattern = Pattern::kHoneycomb;
    parameters.cell = pick(1'500'000, 3'000'000);
    const auto troughs = troughs_of(parameters, layer);
    std::size_t compared = 0;
    for (auto it = troughs.begin(); it != troughs.end() && std::next(it) != troughs.end(); ++it) {
      const auto& [line, at] = *it;
      const auto& [next, above] = *std::next(it);
      if (line < 0 || next != line + 1) continue;
      ++compared;
      ASSERT_EQ(above - at - infill::wave_height(parameters), of_lines[static_cast<std::size_t>(line)])
          << "turn " << turn << ", wave " << line;
    }
    EXPECT_GT(compared, 1u) << "turn " << turn;
  }
}

TEST(CurvesAndWaves, GapsOfCurvesFollowTheirDepth) {
  FillParameters parameters;
  parameters.gap_expression = "0.1 + 0.05 * s";
  const auto depths = depths_of(parameters);
  ASSERT_GT(depths.size(), 8u);
  EXPECT_EQ(depths[0], 600'000) << "the first one touches the wall";
  for (std::size_t i = 1; i < depths.size(); ++i) {
    EXPECT_NEAR(depths[i] - depths[i - 1], 500'000 + 0.05 * depths[i - 1], 1) << i;
  }
}

TEST(CurvesAndWaves, StaggerAndFirstLineMoveThem) {
  FillParameters parameters;
  parameters.gaps = {400'000};
  parameters.stagger = {0, 300'000, -200'000};
  parameters.stagger_every_layer = true;
  const auto first = depths_of(parameters, 0), inwards = depths_of(parameters, 1), outwards = depths_of(parameters, 2);
  EXPECT_EQ(first[0], 600'000);
  EXPECT_EQ(inwards[0], 900'000);
  EXPECT_EQ(outwards[0], 1'200'000) << "nothing is deposited into the wall";
  EXPECT_EQ(distances_of(outwards)[0], 800'000);
  parameters.first_line = 2'000'000;
  EXPECT_EQ(depths_of(parameters, 0)[0], 2'000'000);
  EXPECT_EQ(depths_of(parameters, 2)[0], 2'600'000);
  parameters.pattern = Pattern::kHoneycomb;
  const auto still = troughs_of(parameters, 0), moved = troughs_of(parameters, 1);
  for (const auto& [line, at] : still) {
    if (moved.contains(line)) {
      EXPECT_EQ(moved.at(line), at + 300'000);
    }
  }
  EXPECT_EQ(still.at(0), 2'000'000);
}

TEST(CurvesAndWaves, ARasterBeginsWhereTheNextCurveWouldLie) {
  FillParameters parameters;
  parameters.pattern = Pattern::kContourRaster;
  parameters.loops = 3;
  parameters.group = 2;
  parameters.gaps = {500'000};
  parameters.angle_base = 0;
  const auto depths = depths_of(parameters);
  EXPECT_EQ(depths, (std::vector<Nm>{600'000, 1'000'000, 1'900'000}));
  const Contours& square = outline("square");
  const Toolpaths paths = filled(square, context_of(square), parameters);
  Nm leftmost = INT32_MAX;
  for (std::size_t i = 0; i < paths.point.size(); ++i) {
    if (paths.kind[i] == PathKind::kRaster) leftmost = std::min(leftmost, paths.point[i].x);
  }
  EXPECT_EQ(leftmost, 2'300'000);
}

TEST(CurvesAndWaves, ConcentricCurvesLieAtTheirDistance) {
  FillParameters parameters;
  parameters.pattern = Pattern::kContour;
  parameters.gaps = {100'000};
  const Contours& square = outline("square");
  const Toolpaths paths = filled(square, context_of(square), parameters);
  for (std::uint32_t p = 1; p < paths.size(); ++p) {
    EXPECT_TRUE(is_closed(paths, p));
    Nm lowest = INT32_MAX;
    for (const Point2 at : paths.view()[p]) lowest = std::min(lowest, at.x);
    EXPECT_EQ(lowest, 600'000 + static_cast<Nm>(p - 1) * 500'000);
    for (std::uint32_t i = paths.offset[p]; i < paths.offset[p + 1]; ++i)
      ASSERT_EQ(paths.line[i], static_cast<std::int32_t>(p - 1));
  }
  EXPECT_EQ(paths.size(), 1u + 19u);
}

/// So that every n-th one can be found again, around holes too: a number is a depth.
TEST(CurvesAndWaves, ClosedCurvesAreNumberedFromTheSurfaceInwardsAndThoseOfOneDepthAlike) {
  for (const Outline& outline : outlines()) {
    FillParameters parameters;
    parameters.pattern = Pattern::kContour;
    parameters.gaps = {150'000, 400'000};
    for (const std::uint32_t layer : {0u, 1u}) {
      parameters.stagger = {0, -450'000};
      parameters.stagger_every_layer = true;
      const FillContext context = context_of(outline.contours, layer);
      const Toolpaths paths = filled(outline.contours, context, parameters);
      const auto positions =
          infill::positions_inwards(infill::outlines_of(outline.contours, context, parameters)->region, context, parameters);
      ASSERT_TRUE(positions.ok());
      std::int32_t before = INT32_MIN;
      for (std::uint32_t p = 0; p < paths.size(); ++p) {
        const std::int32_t number = paths.line[paths.offset[p]];
        if (paths.kind[paths.offset[p]] != PathKind::kContour) {
          ASSERT_EQ(number, kNoLine);
          continue;
        }
        ASSERT_GE(number, before) << outline.name;
        before = number;
        const auto depth = static_cast<double>(positions->at[static_cast<std::size_t>(number - positions->first_number)]);
        double nearest = 1e300;
        const auto points = paths.view()[p];
        for (std::size_t i = 0; i + 1 < points.size(); ++i) {
          for (const double share : {0.0, 0.5}) {
            const double x = points[i].x + share * (static_cast<double>(points[i + 1].x) - points[i].x);
            const double y = points[i].y + share * (static_cast<double>(points[i + 1].y) - points[i].y);
            const double off = distance_to(outline.contours, x, y);
            ASSERT_GE(off, depth - 60) << outline.name << ", curve " << number;  // rounded once for every curve before it
            nearest = std::min(nearest, off);
          }
        }
        EXPECT_LE(nearest, depth + 60) << outline.name << ", curve " << number;
      }
    }
  }
}

TEST(CurvesAndWaves, HoneycombWavesTouchAndQuatrefoilsStayApart) {
  const Contours& square = outline("square");
  for (const Pattern pattern : {Pattern::kHoneycomb, Pattern::kQuatrefoil}) {
    FillParameters parameters;
    parameters.pattern = pattern;
    parameters.cell = 4 * kMm;
    parameters.angle_base = 0;
    parameters.gaps = {pattern == Pattern::kHoneycomb ? 0 : 250'000};
    const Toolpaths paths = filled(square, context_of(square), parameters);
    // The nearest that two neighbouring waves come to each other, centre to centre.
    std::map<std::int32_t, Contours> waves;
    for (std::uint32_t p = 1; p < paths.size(); ++p) {
      Contours& wave = waves[paths.line[paths.offset[p]]];
      for (const Point2 at : paths.view()[p]) wave.point.push_back(at);
    }
    ASSERT_GT(waves.size(), 4u);
    for (auto it = waves.begin(); std::next(it) != waves.end(); ++it) {
      double nearest = 1e300;
      for (const Point2 a : it->second.point) {
        for (const Point2 b : std::next(it)->second.point) {
          nearest = std::min(nearest, std::hypot(static_cast<double>(a.x) - b.x, static_cast<double>(a.y) - b.y));
        }
      }
      EXPECT_NEAR(nearest, 400'000 + parameters.gaps[0], 2) << it->first;
    }
  }
}

}  // namespace
}  // namespace lamina::test
