// tests/infill/test_fill.cpp: laws of fillings, crossed over outlines, patterns, angles and gaps.
#include <gtest/gtest.h>
#include <tbb/parallel_for.h>

#include <cmath>
#include <filesystem>
#include <iostream>
#include <map>
#include <set>

#include "stages/data/clipping.h"
#include "stages/infill/fill.h"
#include "stages/infill/frame.h"
#include "stages/infill/spacing.h"
#include "stages/load/load.h"
#include "stages/slice/slice.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using infill::FillContext;
using infill::FillParameters;
using infill::Pattern;

constexpr Nm kMm = 1'000'000;

struct Outline {
  std::string name;
  Contours contours;
};

Contours contours_of(std::initializer_list<std::vector<std::array<double, 2>>> all) {
  Contours out;
  for (const auto& one : all) {
    for (const auto& [x, y] : one) out.point.push_back({static_cast<Nm>(std::llround(x * kMm)), static_cast<Nm>(std::llround(y * kMm))});
    out.close();
  }
  return out;
}

/// A layer of a real part, at a share of its height.
Contours layer_of(const char* file, double share) {
  auto part = load::load((std::filesystem::path(LAMINA_TEST_DIR) / "corpus" / file).string(), {});
  EXPECT_TRUE(part.ok());
  std::vector<Instance> instances = part->instances;
  for (Instance& instance : instances) {
    instance.offset.x += 100 * kMm - part->bounds.lo.x;
    instance.offset.y += 50 * kMm - part->bounds.lo.y;
  }
  const std::vector<std::uint32_t> body(instances.size(), 0);
  const std::vector<Nm> planes{static_cast<Nm>(part->bounds.lo.z + share * static_cast<double>(part->bounds.height()))};
  const auto slicer = slice::Slicer::build(part->meshes, instances, body, planes, {});
  slice::LayerScratch scratch;
  slice::LayerContours layer;
  EXPECT_TRUE(slicer->layer(0, scratch, layer).ok());
  EXPECT_GT(layer.contours.size(), 0u) << file;
  return layer.contours;
}

const std::vector<Outline>& outlines() {
  static const std::vector<Outline> all = [] {
    std::vector<Outline> list;
    list.push_back({"square", contours_of({{{0, 0}, {20, 0}, {20, 20}, {0, 20}}})});
    list.push_back({"needle", contours_of({{{0, 0}, {30, -0.3}, {60, 0}, {30, 0.3}}})});
    list.push_back({"sliver", contours_of({{{0, 0}, {25, 24.5}, {25, 25}}})});
    list.push_back({"touching holes", contours_of({{{0, 0}, {20, 0}, {20, 20}, {0, 20}},
                                                   {{4, 4}, {4, 10}, {10, 10}, {10, 4}},
                                                   {{10, 10}, {10, 16}, {16, 16}, {16, 10}}})});
    list.push_back({"islands in holes", contours_of({{{0, 0}, {24, 0}, {24, 24}, {0, 24}},
                                                     {{3, 3}, {3, 21}, {21, 21}, {21, 3}},
                                                     {{6, 6}, {18, 6}, {18, 18}, {6, 18}},
                                                     {{9, 9}, {9, 15}, {15, 15}, {15, 9}}})});
    Contours comb;
    comb.point.push_back({0, 0});
    comb.point.push_back({20 * kMm, 0});
    for (int tooth = 9; tooth >= 0; --tooth) {
      for (const Point2 p : {Point2{tooth * 2 + 2, 12}, {tooth * 2 + 1, 12}, {tooth * 2 + 1, 3}, {tooth * 2, 3}}) {
        if (p.y != 3 || p.x != 0 || tooth != 0) comb.point.push_back({p.x * kMm, p.y * kMm});
      }
    }
    comb.point.push_back({0, 3 * kMm});
    comb.close();
    list.push_back({"comb", comb});
    list.push_back({"nist", layer_of("nist_am_test_artifact_v3b.stl", 0.6)});
    list.push_back({"crown", layer_of("dental_crown.stl", 0.3)});
    list.push_back({"knot", layer_of("quad_knot.obj", 0.45)});
    list.push_back({"nut", layer_of("parameter_quality_nut.stl", 0.5)});
    return list;
  }();
  return all;
}

FillContext context_of(const ContoursView& contours, std::uint32_t index = 0) {
  FillContext context;
  context.layer = {index, static_cast<Nm>(index) * 200'000, 200'000};
  for (const Point2 p : contours.point) context.part.add(Point3{p.x, p.y, 0});
  context.part.add(Point3{contours.point.front().x, contours.point.front().y, 20 * kMm});
  return context;
}

Toolpaths filled(const ContoursView& contours, const FillContext& context, const FillParameters& parameters) {
  Toolpaths paths;
  const Status status = infill::append_fill(contours, context, parameters, paths);
  EXPECT_TRUE(status.ok()) << (status ? "" : status.error().message);
  return paths;
}

/// Whether the stretch ab lies in the region but for `slack` nm, looked at in many points.
bool stays_inside(const ContoursView& region, Point2 a, Point2 b, double slack) {
  constexpr int kSteps = 7;
  for (int k = 0; k <= kSteps; ++k) {
    const double x = a.x + (static_cast<double>(b.x) - a.x) * k / kSteps, y = a.y + (static_cast<double>(b.y) - a.y) * k / kSteps;
    if (winding_about(region, {static_cast<Nm>(std::llround(x)), static_cast<Nm>(std::llround(y))}) != 0) continue;
    if (distance_to(region, x, y) > slack) return false;
  }
  return true;
}

struct Sums {
  double raster = 0, link = 0, closed = 0;
};
Sums sums_of(const Toolpaths& paths) {
  Sums sums;
  for (std::uint32_t p = 0; p < paths.size(); ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      const double length = std::hypot(static_cast<double>(b.x) - a.x, static_cast<double>(b.y) - a.y);
      if (paths.kind[i] == PathKind::kRaster) sums.raster += length;
      if (paths.kind[i] == PathKind::kLink) sums.link += length;
      if (paths.kind[i] == PathKind::kContour) sums.closed += length;
    }
  }
  return sums;
}

TEST(Fill, NoBeadCentreLeavesItsRegionWhateverOutlinePatternAngleAndGap) {
  std::size_t stretches = 0;
  for (const Outline& outline : outlines()) {
    for (const Pattern pattern : {Pattern::kRaster, Pattern::kContour, Pattern::kContourRaster, Pattern::kHoneycomb, Pattern::kQuatrefoil}) {
      for (const infill::MicroDegrees angle : {0, 90'000'000, 45'000'000, 12'345'678, 270'000'000, 211'000'000}) {
        for (const Nm gap : {-100'000, 0, 300'000}) {
          FillParameters parameters;
          parameters.pattern = pattern;
          parameters.angle_base = angle;
          parameters.gaps = {pattern == Pattern::kQuatrefoil ? std::max(gap, 50'000) : gap};
          parameters.cell = 3 * kMm;
          const FillContext context = context_of(outline.contours);
          const auto region = infill::fill_region(outline.contours, context, parameters);
          ASSERT_TRUE(region.ok());
          const Toolpaths paths = filled(outline.contours, context, parameters);
          ASSERT_EQ(paths.kind.size(), paths.point.size());
          ASSERT_EQ(paths.width.size(), paths.point.size());
          ASSERT_EQ(paths.line.size(), paths.point.size());
          for (std::uint32_t p = 0; p < paths.size(); ++p) {
            ASSERT_GE(paths.view()[p].size(), 2u);
            const bool wall = paths.kind[paths.offset[p]] == PathKind::kOuter;
            const ContoursView within = wall ? ContoursView(outline.contours) : ContoursView(*region);
            // Looking is slow: some hundred stretches of each filling, others each time.
            const auto step = static_cast<std::uint32_t>(1 + paths.point.size() * within.point.size() / 10'000);
            for (std::uint32_t i = paths.offset[p] + static_cast<std::uint32_t>(stretches % step); i + 1 < paths.offset[p + 1]; i += step) {
              ++stretches;
              ASSERT_TRUE(stays_inside(within, paths.point[i], paths.point[i + 1], 3))
                  << outline.name << ", pattern " << static_cast<int>(pattern) << ", angle " << angle << ", gap " << gap
                  << ", path " << p << ", stretch " << i - paths.offset[p];
            }
          }
        }
      }
    }
  }
  EXPECT_GT(stretches, 20'000u);
  std::cout << stretches << " stretches looked at\n";
}

TEST(Fill, LengthTimesDistanceTendsToTheArea) {
  for (const Outline& outline : outlines()) {
    for (const infill::MicroDegrees angle : {0, 45'000'000, 77'000'000}) {
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

TEST(Fill, RasterLinesLieExactlyAtTheirDistance) {
  for (const auto& [angle, axis] : {std::pair<infill::MicroDegrees, int>{0, 0}, {90'000'000, 1}, {180'000'000, 0}, {270'000'000, 1}}) {
    FillParameters parameters;
    parameters.angle_base = angle;
    parameters.gaps = {123'457};
    const Contours& square = outlines()[0].contours;
    const Toolpaths paths = filled(square, context_of(square), parameters);
    std::map<std::int32_t, Nm> places;
    for (std::size_t i = 0; i < paths.point.size(); ++i) {
      if (paths.kind[i] != PathKind::kRaster || paths.line[i] == kNoLine) continue;
      const Nm at = axis == 0 ? paths.point[i].y : paths.point[i].x;
      const auto [found, is_new] = places.emplace(paths.line[i], at);
      EXPECT_EQ(found->second, at) << "a line is straight";
    }
    ASSERT_GT(places.size(), 30u);
    for (auto it = std::next(places.begin()); it != places.end(); ++it) {
      EXPECT_EQ(std::abs(it->second - std::prev(it)->second), 523'457 * (it->first - std::prev(it)->first));
    }
    // 90 degrees: lines run along y and are counted towards -x, from the right side.
    EXPECT_EQ(places.begin()->first, 0);
    const Nm first = axis == 0 ? places[0] : 20 * kMm - places[0];
    EXPECT_EQ(first, 200'000 + 523'457);
  }
}

TEST(Fill, ZigzagAlternatesAndStaysOneToolpathOnASquare) {
  FillParameters parameters;
  parameters.angle_base = 0;
  const Contours& square = outlines()[0].contours;
  const Toolpaths paths = filled(square, context_of(square), parameters);
  ASSERT_EQ(paths.size(), 2u) << "a wall, and a zigzag without a stop";
  EXPECT_EQ(paths.kind[0], PathKind::kOuter);
  EXPECT_TRUE(paths.view().is_closed(0));
  for (std::uint32_t i = paths.offset[1]; i + 1 < paths.offset[2]; ++i) {
    if (paths.kind[i] != PathKind::kRaster) continue;
    EXPECT_EQ(paths.point[i + 1].x > paths.point[i].x, paths.line[i] % 2 == 0);
  }
}

TEST(Fill, StaggerComesWithEveryReturnOfTheAngleAndBuildLayersKeepIt) {
  FillParameters parameters;
  parameters.angle_step = 60'000'000;
  parameters.build_layers = 2;
  parameters.stagger = {0, 100'000, 50'000};
  for (std::uint32_t layer = 0; layer < 40; ++layer) {
    EXPECT_EQ(infill::layer_angle(parameters, layer), (45'000'000 + layer / 2 * 60'000'000ll) % infill::kTurn);
    EXPECT_EQ(infill::layer_stagger(parameters, layer), parameters.stagger[layer / 6 % 3]);
  }
  parameters.stagger_every_layer = true;
  for (std::uint32_t layer = 0; layer < 9; ++layer) EXPECT_EQ(infill::layer_stagger(parameters, layer), parameters.stagger[layer % 3]);
  // 45, 135, 225, 315 degrees: Lima 2009, Appendix B.
  parameters = FillParameters();
  for (std::uint32_t layer = 0; layer < 58; ++layer) EXPECT_EQ(infill::layer_angle(parameters, layer), 45'000'000 + layer % 4 * 90'000'000ll);
}

/// Places of the lines on a 20 x 20 mm square at angle 0, from its side.
std::vector<Nm> places_of(const FillParameters& parameters, std::uint32_t layer = 0) {
  const Contours& square = outlines()[0].contours;
  FillParameters own = parameters;
  own.angle_base = own.angle_step = 0;
  const Toolpaths paths = filled(square, context_of(square, layer), own);
  std::set<Nm> places;
  for (std::size_t i = 0; i < paths.point.size(); ++i) {
    if (paths.line[i] != kNoLine) places.insert(paths.point[i].y);
  }
  return {places.begin(), places.end()};
}

std::vector<Nm> distances_of(const std::vector<Nm>& places) {
  std::vector<Nm> distances;
  for (std::size_t i = 1; i < places.size(); ++i) distances.push_back(places[i] - places[i - 1]);
  return distances;
}

TEST(Fill, GroupsAlternatingGapsAndDistancesAreAsDefined) {
  FillParameters parameters;
  parameters.group = 2;
  parameters.gaps = {600'000};
  auto distances = distances_of(places_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) EXPECT_EQ(distances[i], i % 2 == 0 ? 400'000 : 1'000'000) << i;
  parameters.group = 1;
  parameters.gaps = {100'000, 700'000};
  distances = distances_of(places_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) EXPECT_EQ(distances[i], i % 2 == 0 ? 500'000 : 1'100'000) << i;
  parameters.group = 3;
  distances = distances_of(places_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) {
    EXPECT_EQ(distances[i], i % 3 != 2 ? 400'000 : i / 3 % 2 == 0 ? 500'000 : 1'100'000) << i;
  }
  parameters.distances = {430'000, 400'000, 430'000};  // S-C, C-C, C-S of Di Nisio 2022
  distances = distances_of(places_of(parameters));
  for (std::size_t i = 0; i < distances.size(); ++i) EXPECT_EQ(distances[i], i % 3 == 1 ? 400'000 : 430'000) << i;
}

TEST(Fill, StaggerMovesTheLinesOfTheLayer) {
  FillParameters parameters;
  parameters.gaps = {400'000};
  parameters.stagger = {0, 300'000};
  const auto even = places_of(parameters, 0), odd = places_of(parameters, 1), again = places_of(parameters, 2);
  EXPECT_EQ(even, again);
  for (const Nm place : odd) EXPECT_EQ((place - even[0] - 300'000) % 800'000, 0);
  EXPECT_EQ(distances_of(odd)[3], 800'000);
}

TEST(Fill, GapsFollowTheTableOfHeightsAndTheFormula) {
  FillParameters parameters;  // 750 -> 100 -> 750 micrometres: Sobral 2011, Grad 1
  parameters.gap_table = {{0, 750'000}, {10 * kMm, 100'000}, {20 * kMm, 750'000}};
  for (const std::uint32_t layer : {0u, 24u, 49u, 50u, 80u}) {
    const double z = layer * 200'000.0 + 100'000;
    const double gap = z < 10 * kMm ? 750'000 - z * 0.065 : 100'000 + (z - 10 * kMm) * 0.065;
    EXPECT_NEAR(distances_of(places_of(parameters, layer))[0], 400'000 + gap, 1) << layer;
    FillParameters formula;
    formula.gap_expression = "z < 10 ? 0.75 - z * 0.065 : 0.1 + (z - 10) * 0.065";
    EXPECT_NEAR(distances_of(places_of(formula, layer))[0], 400'000 + gap, 1) << layer;
  }
  FillParameters across;
  across.gap_expression = "0.2 + 0.8 * u";
  const auto places = places_of(across);
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double gap = 0.2 + 0.8 * places[i - 1] / (20.0 * kMm);
    EXPECT_NEAR(places[i] - places[i - 1], 400'000 + gap * 1e6, 1) << i;
  }
}

/// Di Nisio 2022, sections 3.2.2 and 3.2.3: blocks 62 and 48 mm wide, bead 0.4, one contour, a gap of 2 mm: 24 and 18
/// lines, of which every other one, 12 and 9, is segmented.
TEST(Fill, DocumentsTestLayoutsHaveTwelveAndNineSegmentedLines) {
  for (const auto& [wide, lines] : {std::pair{62.0, 24u}, {48.0, 18u}}) {
    const Contours block = contours_of({{{0, 0}, {wide, 0}, {wide, 50}, {0, 50}}});
    FillParameters parameters;
    parameters.gaps = {2 * kMm};
    parameters.angle_base = 90'000'000;
    parameters.angle_step = 0;
    const Toolpaths paths = filled(block, context_of(block), parameters);
    std::set<std::int32_t> numbers;
    std::set<Nm> places;
    std::uint32_t segmented = 0;
    for (std::size_t i = 0; i < paths.point.size(); ++i) {
      if (paths.line[i] == kNoLine) continue;
      if (numbers.insert(paths.line[i]).second && paths.line[i] % 2 != 0) ++segmented;
      places.insert(paths.point[i].x);
    }
    EXPECT_EQ(numbers.size(), lines);
    EXPECT_EQ(segmented, lines / 2);
    EXPECT_EQ(*places.rbegin(), static_cast<Nm>(wide * kMm) - 2'600'000) << "one distance from the wall's centre";
  }
}

TEST(Fill, ConcentricCurvesLieAtTheirDistance) {
  FillParameters parameters;
  parameters.pattern = Pattern::kContour;
  parameters.gaps = {100'000};
  const Contours& square = outlines()[0].contours;
  const Toolpaths paths = filled(square, context_of(square), parameters);
  for (std::uint32_t p = 1; p < paths.size(); ++p) {
    EXPECT_TRUE(paths.view().is_closed(p));
    Nm lowest = INT32_MAX;
    for (const Point2 at : paths.view()[p]) lowest = std::min(lowest, at.x);
    EXPECT_EQ(lowest, 600'000 + static_cast<Nm>(p - 1) * 500'000);
  }
  EXPECT_EQ(paths.size(), 1u + 19u);
}

TEST(Fill, HoneycombWavesTouchAndQuatrefoilsStayApart) {
  const Contours& square = outlines()[0].contours;
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

TEST(Fill, SameBytesFromAnyThreadInAnyOrder) {
  const Contours& knot = outlines()[8].contours;
  FillParameters parameters;
  parameters.gap_expression = "0.1 + 0.05 * sin(s) + 0.01 * n";
  parameters.angle_step = 37'000'000;
  std::vector<Toolpaths> once(24), many(24);
  for (std::uint32_t layer = 0; layer < 24; ++layer) once[layer] = filled(knot, context_of(knot, layer), parameters);
  tbb::parallel_for(0u, 24u, [&](std::uint32_t i) { many[23 - i] = filled(knot, context_of(knot, 23 - i), parameters); });
  for (std::uint32_t layer = 0; layer < 24; ++layer) {
    EXPECT_TRUE(once[layer].point == many[layer].point && once[layer].offset == many[layer].offset &&
                once[layer].kind == many[layer].kind && once[layer].line == many[layer].line) << layer;
  }
}

TEST(Fill, WhatCannotBeLaidIsOneClearLine) {
  const Contours& square = outlines()[0].contours;
  const auto message = [&](const FillParameters& parameters) {
    Toolpaths paths;
    Status status = infill::check(parameters);
    if (status) status = infill::append_fill(square, context_of(square), parameters, paths);
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
}

}  // namespace
}  // namespace lamina::test
