// tests/infill/test_fill.cpp: laws of all fillings, crossed over outlines, patterns, angles and gaps.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <iostream>

#include "tests/infill/outlines.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using infill::FillContext;
using infill::FillParameters;
using infill::Pattern;

/// Whether the segment ab is in the region within `slack` nm, tested at many points.
bool stays_inside(const ContoursView& region, Point2 a, Point2 b, double slack) {
  constexpr int kSteps = 7;
  for (int k = 0; k <= kSteps; ++k) {
    const double x = a.x + (static_cast<double>(b.x) - a.x) * k / kSteps,
                 y = a.y + (static_cast<double>(b.y) - a.y) * k / kSteps;
    if (winding_about(region, {static_cast<Nm>(std::llround(x)), static_cast<Nm>(std::llround(y))}) != 0) continue;
    if (distance_to(region, x, y) > slack) return false;
  }
  return true;
}

TEST(Fill, NoBeadCentreLeavesItsRegionForAnyOutlinePatternAngleAndGap) {
  std::size_t intervals = 0;
  for (const Outline& outline : outlines()) {
    for (const Pattern pattern :
         {Pattern::kRaster, Pattern::kContour, Pattern::kContourRaster, Pattern::kHoneycomb, Pattern::kQuatrefoil}) {
      for (const MicroDegrees angle : {0, 90'000'000, 45'000'000, 12'345'678, 270'000'000, 211'000'000}) {
        for (const Nm gap : {-100'000, 0, 300'000}) {
          FillParameters parameters;
          parameters.pattern = pattern;
          parameters.angle_base = angle;
          parameters.gaps = {pattern == Pattern::kQuatrefoil ? std::max(gap, 50'000) : gap};
          parameters.cell = 3 * kMm;
          if (gap == 300'000) parameters.stagger = {170'000};
          if (gap == -100'000 && pattern != Pattern::kQuatrefoil) parameters.group = 3;
          const FillContext context = context_of(outline.contours);
          const auto outlines = infill::outlines_of(outline.contours, context, parameters);
          ASSERT_TRUE(outlines.ok());
          const Contours& region = outlines->region;
          const Toolpaths paths = filled(outline.contours, context, parameters);
          const auto bound = infill::bound_fill(outline.contours, *outlines, context, parameters);
          ASSERT_TRUE(bound.ok());
          ASSERT_LE(paths.point.size(), bound->points) << outline.name << ", pattern " << static_cast<int>(pattern);
          ASSERT_EQ(paths.kind.size(), paths.point.size());
          ASSERT_EQ(paths.width.size(), paths.point.size());
          ASSERT_EQ(paths.line.size(), paths.point.size());
          for (std::uint32_t p = 0; p < paths.size(); ++p) {
            ASSERT_GE(paths.view()[p].size(), 2u);
            const bool wall = paths.kind[paths.offset[p]] == PathKind::kOuter;
            const ContoursView within = wall ? ContoursView(outline.contours) : ContoursView(region);
            // The test is slow: some hundred segments of each filling, different ones each time.
            const auto step = static_cast<std::uint32_t>(1 + paths.point.size() * within.point.size() / 10'000);
            for (std::uint32_t i = paths.offset[p] + static_cast<std::uint32_t>(intervals % step); i + 1 < paths.offset[p + 1];
                 i += step) {
              ++intervals;
              ASSERT_TRUE(stays_inside(within, paths.point[i], paths.point[i + 1], 3))
                  << outline.name << ", pattern " << static_cast<int>(pattern) << ", angle " << angle << ", gap " << gap
                  << ", path " << p << ", stretch " << i - paths.offset[p];
            }
          }
        }
      }
    }
  }
  EXPECT_GT(intervals, 20'000u);
  std::cout << intervals << " intervals checked\n";
}

TEST(Fill, LengthTimesDistanceTendsToTheArea) {
  for (const Outline& outline : outlines()) {
    for (const MicroDegrees angle : {0, 45'000'000, 77'000'000}) {
      for (const Nm width : {400'000, 100'000, 25'000}) {
        FillParameters parameters;
        parameters.walls = 0;
        parameters.end_inset = 0;
        parameters.width = width;
        parameters.angle_base = angle;
        parameters.longest_link = 0;
        const FillContext context = context_of(outline.contours);
        const double area = static_cast<double>(doubled_area(outline.contours)) / 2;
        const Sums sums = sums_of(filled(outline.contours, context, parameters));
        const double off = std::abs(sums.raster * width - area);
        // A line stands for half a distance on each side of it: no more than the edge's strip can be wrong.
        EXPECT_LE(off, perimeter(outline.contours) * width / 2) << outline.name << " at " << angle << ", bead " << width;
      }
    }
  }
}

TEST(Fill, SameBytesFromAnyThreadInAnyOrder) {
  const Contours& knot = outline("knot");
  FillParameters parameters;
  parameters.gap_expression = "0.1 + 0.05 * sin(s) + 0.01 * n";
  parameters.angle_step = 37'000'000;
  std::vector<Toolpaths> once(24), many(24);
  for (std::uint32_t layer = 0; layer < 24; ++layer) once[layer] = filled(knot, context_of(knot, layer), parameters);
  tbb::parallel_for(0u, 24u, [&](std::uint32_t i) { many[23 - i] = filled(knot, context_of(knot, 23 - i), parameters); });
  for (std::uint32_t layer = 0; layer < 24; ++layer) {
    EXPECT_TRUE(once[layer].point == many[layer].point && once[layer].offset == many[layer].offset &&
                once[layer].kind == many[layer].kind && once[layer].line == many[layer].line)
        << layer;
  }
}

TEST(Fill, AFormulaHasToHoldWithinThePartOnly) {
  const Contours& square = outline("square");
  FillParameters parameters;
  parameters.walls = 0;
  parameters.gap_expression = "0.1 + sqrt(s) * sqrt(1 - u) / 10";
  parameters.stagger = {-300'000};
  for (const Pattern pattern : {Pattern::kRaster, Pattern::kContour, Pattern::kHoneycomb, Pattern::kQuatrefoil}) {
    parameters.pattern = pattern;
    if (pattern == Pattern::kContour) parameters.gap_expression = "0.1 + sqrt(s)";
    if (pattern == Pattern::kHoneycomb) parameters.gap_expression = "0.1 + sqrt(s) * sqrt(1 - u)";
    for (const MicroDegrees angle : {0, 30'000'000}) {
      parameters.angle_base = angle;
      Toolpaths paths;
      const Status status = fill(square, context_of(square), parameters, paths);
      ASSERT_TRUE(status.ok()) << status.error().message;
      EXPECT_GT(paths.size(), 0u);
    }
  }
  // Half a bead before the surface there is no wall: the gap to line 0 is that of the part's side.
  parameters.pattern = Pattern::kRaster;
  parameters.stagger = {0};
  parameters.angle_base = 0;
  parameters.gap_expression = "0.3 + s";
  const Toolpaths paths = filled(square, context_of(square), parameters);
  ASSERT_GT(paths.size(), 0u);
  EXPECT_EQ(paths.point[0].y - context_of(square).part.lo.y, parameters.width / 2 + 300'000);
}

TEST(Fill, WhatCannotBeDepositedIsOneClearLine) {
  const Contours& square = outline("square");
  const auto message = [&](const FillParameters& parameters) {
    Toolpaths paths;
    Status status = infill::check(parameters);
    if (status) status = fill(square, context_of(square), parameters, paths);
    EXPECT_FALSE(status.ok());
    if (status) return std::string();
    EXPECT_EQ(status.error().fault, Fault::kUsage);
    EXPECT_EQ(status.error().message.find('\n'), std::string::npos);
    return status.error().message;
  };
  FillParameters p;
  p.gaps = {-400'000};
  EXPECT_NE(message(p).find("above 0"), std::string::npos);
  p = FillParameters();
  p.distances = {0};
  EXPECT_NE(message(p).find("0 mm between lines"), std::string::npos);
  p = FillParameters();
  p.gap_expression = "0.2 +";
  EXPECT_NE(message(p).find("'0.2 +'"), std::string::npos);
  p.gap_expression = "1 / (i - 3) ^ 2";
  EXPECT_NE(message(p).find("finite"), std::string::npos);
  p.gap_expression = "-0.4 - i";
  EXPECT_NE(message(p).find("bead width plus gap"), std::string::npos);
  p.gap_expression = "foo(3)";
  EXPECT_NE(message(p).find("variables are"), std::string::npos);
  p.gap_expression = "z = 3";
  EXPECT_NE(message(p).find("assigns"), std::string::npos);
  p = FillParameters();
  p.width = 0;
  EXPECT_NE(message(p).find("width"), std::string::npos);
  p = FillParameters();
  p.pattern = Pattern::kQuatrefoil;
  EXPECT_NE(message(p).find("kept apart"), std::string::npos);
  p.gaps = {200'000};
  p.group = 2;
  EXPECT_NE(message(p).find("groups of 1"), std::string::npos);
  for (const Pattern pattern : {Pattern::kContour, Pattern::kContourRaster}) {
    p = FillParameters();
    p.pattern = pattern;
    p.gap_expression = "0.1 + u";
    EXPECT_NE(message(p).find("u means nothing"), std::string::npos);
    p.gap_expression = "-0.1 - s";
    EXPECT_NE(message(p).find("bead width plus gap"), std::string::npos);
  }
}

}  // namespace
}  // namespace lamina::test
