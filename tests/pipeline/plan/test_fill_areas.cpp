// tests/pipeline/plan/test_fill_areas.cpp: parts that touch or overlap are filled each by its own parameters, in its own room.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "pipeline/job/file.h"
#include "stages/formats/slice_format.h"
#include "stages/formats/svg/svg.h"
#include "stages/geometry/clipping.h"
#include "tests/commands/program.h"
#include "tests/pipeline/plan/plan_of.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using namespace pipeline;

constexpr double kMm = 1e6;

Contours rectangle(double x0, double y0, double x1, double y1) {
  Contours out;
  for (const auto& [x, y] : {std::pair{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}}) {
    out.point.push_back({static_cast<Nm>(std::llround(x * kMm)), static_cast<Nm>(std::llround(y * kMm))});
  }
  out.close();
  return out;
}

struct Placed {
  std::array<double, 3> at, size;
  std::string fill;
};

/// Every bead of area `a` lies inside `room`: its centre, and half its width to all sides.
void expect_within(const Sections::Work& work, std::size_t a, const ContoursView& capacity, Nm width, PathKind kind) {
  const ToolpathsView paths = work.paths;
  std::size_t detected = 0;
  for (std::uint32_t p = work.path_area[a]; p < work.path_area[a + 1]; ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      EXPECT_EQ(paths.width[i], width);
      detected += paths.kind[i] == kind ? 1 : 0;
      for (int k = 0; k <= 8; ++k) {
        const double x = paths.point[i].x + (static_cast<double>(paths.point[i + 1].x) - paths.point[i].x) * k / 8;
        const double y = paths.point[i].y + (static_cast<double>(paths.point[i + 1].y) - paths.point[i].y) * k / 8;
        ASSERT_EQ(winding_about(capacity, {static_cast<Nm>(std::llround(x)), static_cast<Nm>(std::llround(y))}), 1)
            << "area " << a;
        ASSERT_GE(distance_to(capacity, x, y), width / 2 - 2) << "area " << a;
      }
    }
  }
  EXPECT_GT(detected, 3u) << "area " << a;
}

/// A prism over a star-shaped outline around the origin, in mm.
void write_prism(const std::string& path, const std::vector<std::array<double, 2>>& outline, double height) {
  std::string text = "solid prism\n";
  const auto facet = [&](std::initializer_list<std::array<double, 3>> corners) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (const auto& c : corners) text += fmt::format("vertex {:.6f} {:.6f} {:.6f}\n", c[0], c[1], c[2]);
    text += "endloop\nendfacet\n";
  };
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const auto &a = outline[i], &b = outline[(i + 1) % outline.size()];
    facet({{0, 0, 0}, {b[0], b[1], 0}, {a[0], a[1], 0}});
    facet({{0, 0, height}, {a[0], a[1], height}, {b[0], b[1], height}});
    facet({{a[0], a[1], 0}, {b[0], b[1], 0}, {b[0], b[1], height}});
    facet({{a[0], a[1], 0}, {b[0], b[1], height}, {a[0], a[1], height}});
  }
  write_text(path, text + "endsolid prism\n");
}

class FillAreas : public ::testing::Test {
 protected:
  Result<Plan> plan_of(const std::vector<Placed>& parts, const std::string& ranges = {}) {
    Job job;
    job.layer_mm = 0.5;
    job.fill.all.walls = 1;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      PartRequest part;
      part.path = directory_ / ("part" + std::to_string(i) + ".stl");
      const auto& size = parts[i].size;
      write_box(part.path, {0, 0, 0}, {static_cast<float>(size[0]), static_cast<float>(size[1]), static_cast<float>(size[2])});
      part.at_mm = {parts[i].at[0], parts[i].at[1]};
      part.bottom_mm = parts[i].at[2];
      job.parts.push_back(part);
      const std::string fill = parts[i].fill.empty() ? "{}" : parts[i].fill;
      EXPECT_TRUE(set_key(job, fmt::format("part.{}.fill={}", i + 1, fill)).ok()) << fill;
    }
    EXPECT_TRUE(set_key(job, "fill.range=" + (ranges.empty() ? "[]" : ranges)).ok()) << ranges;
    return test::plan_of(job, Product::kContours);
  }
  Directory directory_;
};

TEST_F(FillAreas, PartsWhoseBoxesTouchKeepTheirOwnFillingAndHeights) {
  const auto plan = plan_of({{{20, 20, 0}, {20, 20, 4}, "{ pattern = 'raster', angle_deg = 0, width_mm = 0.4 }"},
                             {{40, 20, 1}, {20, 20, 4}, "{ pattern = 'contour', width_mm = 0.6 }"}},
                            "[{ from_mm = 2, to_mm = 3, gap_mm = 0.5 }]");
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  ASSERT_EQ(plan->sections->areas().size(), 2u);
  for (std::uint32_t layer = 0; layer < plan->sections->layers().size(); ++layer) {
    // Each by the height above its own bottom.
    for (const auto& area : plan->sections->areas()) {
      const double z = mm(plan->sections->layers()[layer].layer.plane() - area.box.lo.z);
      EXPECT_EQ(plan->sections->filling(area, plan->sections->layers()[layer].layer).gaps[0], z >= 2 && z < 3 ? 500'000 : 0)
          << layer;
    }
  }
  Sections::Work work;
  ASSERT_TRUE(plan->sections->layer(4, work).ok());  // z 2.25: both are solid
  EXPECT_EQ(work.contours.contours.size(), 1u) << "contours are merged";
  EXPECT_NEAR(square_mm(doubled_area(work.contours.contours)), 800, 1e-9);
  expect_within(work, 0, rectangle(20, 20, 40, 40), 400'000, PathKind::kRaster);
  expect_within(work, 1, rectangle(40, 20, 60, 40), 600'000, PathKind::kContour);
}

TEST_F(FillAreas, SharedSpaceBelongsToTheFirstPart) {
  const auto plan = plan_of({{{20, 20, 0}, {20, 20, 4}, "{ pattern = 'raster', width_mm = 0.4, gap_mm = 0.3 }"},
                             {{30, 25, 0}, {20, 20, 4}, "{ pattern = 'contour+raster', width_mm = 0.5 }"},
                             {{25, 35, 0}, {8, 30, 4}, "{ pattern = 'honeycomb', width_mm = 0.3, cell_mm = 3 }"}});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  Sections::Work work;
  ASSERT_TRUE(plan->sections->layer(3, work).ok());
  const Contours first = rectangle(20, 20, 40, 40), second = rectangle(30, 25, 50, 45), third = rectangle(25, 35, 33, 65);
  const auto second_rest = subtract_contours(second, first);
  auto third_rest = subtract_contours(third, first);
  ASSERT_TRUE(second_rest.ok() && third_rest.ok());
  third_rest = subtract_contours(*third_rest, second);
  ASSERT_TRUE(third_rest.ok());
  EXPECT_NEAR(square_mm(doubled_area(*second_rest)), 400 - 10 * 15, 1e-9);
  EXPECT_NEAR(square_mm(doubled_area(*third_rest)), 8 * 25 - 3 * 5, 1e-9);
  expect_within(work, 0, first, 400'000, PathKind::kRaster);
  expect_within(work, 1, *second_rest, 500'000, PathKind::kRaster);
  expect_within(work, 2, *third_rest, 300'000, PathKind::kRaster);
}

/// Bytes that the filling of layer 2 is charged with as SVG, and the least that buffers of doubling size come to at most.
/// Checks what they hold.
std::array<double, 2> charged_and_needed(const Sections& plan) {
  Sections::Work work;
  EXPECT_TRUE(plan.contours(2, work).ok());
  const auto bound = plan.fill_bytes_bound(2, work, {26, 200, 0}), own = plan.fill_bytes_bound(2, work, {});
  EXPECT_TRUE(bound.ok() && own.ok());
  const std::uint64_t before = work.bytes();
  EXPECT_TRUE(plan.fill(2, work).ok());
  EXPECT_LE(work.bytes(), before + *own);
  const auto encoder = formats::make_svg_encoder();
  formats::SliceHead head;
  head.parts.assign(work.contours.body.size() - 1, "part");
  head.bounds = plan.bounds();
  Buffer<char> text, outlines_alone;
  encoder->layer(head, {plan.layers()[2].layer, work.contours.contours, work.contours.body, work.paths, work.path_body}, text);
  encoder->layer(head, {plan.layers()[2].layer, work.contours.contours, work.contours.body, {}, {}}, outlines_alone);
  const std::uint64_t needed = 2 * (text.size() - outlines_alone.size() + 17 * work.paths.point.size() + 4 * work.paths.size());
  EXPECT_LE(needed, *bound);
  return {static_cast<double>(*bound), static_cast<double>(needed)};
}

TEST_F(FillAreas, FineFillingsAreChargedWithAFewTimesWhatTheyNeed) {
  for (const auto& [fill, times] : {std::pair{"{ pattern = 'raster', width_mm = 0.01 }", 3},
                                    {"{ pattern = 'honeycomb', width_mm = 0.05, cell_mm = 0.3 }", 3},
                                    {"{ pattern = 'quatrefoil', width_mm = 0.05, gap_mm = 0.05, cell_mm = 0.3 }", 3},
                                    {"{ pattern = 'contour', width_mm = 0.01 }", 6}}) {
    const auto plan = plan_of({{{20, 20, 0}, {40, 40, 4}, fill}});
    ASSERT_TRUE(plan.ok()) << plan.error().message;
    const auto [charged, needed] = charged_and_needed(*plan->sections);
    EXPECT_LT(charged, times * needed) << fill << ": " << charged << " for " << needed;
  }
}

TEST_F(FillAreas, RandomOutlinesAndPatternsNeedNoMoreThanTheyAreChargedWith) {
  std::mt19937 random(4711);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967295.0;
  };
  const char* patterns[] = {"raster", "contour", "contour+raster", "honeycomb", "quatrefoil"};
  for (int turn = 0; turn < 60; ++turn) {
    // A star-shaped prism of random corners and a random one next to it, turned any way by its corners.
    const auto corners = static_cast<int>(between(3, turn % 3 == 0 ? 400 : 30));
    std::vector<std::array<double, 2>> outline;
    const double minimum = between(0.05, 1);
    for (int i = 0; i < corners; ++i) {
      const double angle = (i + between(0, 0.5)) * 2 * std::numbers::pi / corners, radius = 12 * between(minimum, 1);
      outline.push_back({radius * std::cos(angle), radius * std::sin(angle)});
    }
    const std::string path = directory_ / ("star" + std::to_string(turn) + ".stl");
    write_prism(path, outline, 4);
    Job job;
    job.bed_mm = {100, 100};
    job.layer_mm = 0.5;
    job.parts.emplace_back();
    job.parts.back().path = path;
    const std::string fill = fmt::format(
        "{{ pattern = '{}', width_mm = {:.3f}, gap_mm = {:.3f}, cell_mm = {:.3f}, angle_deg = {:.1f}, walls = {}, loops = {} }}",
        patterns[turn % 5], between(0.05, 0.3), between(0.02, 0.3), between(0.3, 2), between(0, 180), turn % 4 == 0 ? 1 : 0,
        static_cast<int>(between(1, 40)));
    ASSERT_TRUE(set_key(job, "part.fill=" + fill).ok()) << fill;
    const auto plan = test::plan_of(job, Product::kContours);
    ASSERT_TRUE(plan.ok()) << plan.error().message;
    SCOPED_TRACE(fill);
    charged_and_needed(*plan->sections);
  }
}

TEST_F(FillAreas, WhatFollowsTheCountOfPointsIsWithinIt) {
  const auto plan =
      plan_of({{{20, 20, 0}, {20, 20, 4}, "{ pattern = 'raster', width_mm = 0.02 }"},
               {{40, 20, 0}, {20, 20, 4}, "{ pattern = 'quatrefoil', width_mm = 0.1, gap_mm = 0.1, cell_mm = 0.3 }"},
               {{70, 20, 0}, {20, 20, 4}, "{ pattern = 'contour', width_mm = 0.02 }"}});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  Sections::Work work;
  ASSERT_TRUE(plan->sections->contours(2, work).ok());
  const auto bound = plan->sections->fill_bytes_bound(2, work, {});
  ASSERT_TRUE(bound.ok());
  const std::uint64_t before = work.bytes();
  ASSERT_TRUE(plan->sections->fill(2, work).ok());
  EXPECT_GT(work.paths.point.size(), 50'000u);
  EXPECT_LE(work.bytes(), before + *bound);
}

/// Toolpaths of all areas of a layer.
void expect_same_paths(const Sections::Work& a, const Sections::Work& b, std::uint32_t layer) {
  ASSERT_EQ(a.paths.offset, b.paths.offset) << "layer " << layer;
  ASSERT_EQ(a.paths.kind, b.paths.kind) << "layer " << layer;
  ASSERT_EQ(a.paths.width, b.paths.width) << "layer " << layer;
  ASSERT_EQ(a.paths.line, b.paths.line) << "layer " << layer;
  ASSERT_EQ(a.paths.point, b.paths.point) << "layer " << layer;
  ASSERT_EQ(a.path_area, b.path_area) << "layer " << layer;
}

/// Copies of one part, and as many parts of the same file in their positions, which are filled one by one.
TEST(FilledCopies, AreFilledOnceAsIfEachWereFilled) {
  for (const infill::Pattern pattern :
       {infill::Pattern::kNone, infill::Pattern::kRaster, infill::Pattern::kContour, infill::Pattern::kContourRaster,
        infill::Pattern::kHoneycomb, infill::Pattern::kQuatrefoil}) {
    Job job;
    job.dry_run = true;
    job.layer_mm = 0.7;
    job.gap_mm = 3.000137;
    job.parts.resize(1);
    job.parts[0].path = LAMINA_TEST_DIR "/corpus/dental_crown.stl";
    job.parts[0].copies = 7;
    job.fill.all.walls = 2;
    job.fill.all.pattern = pattern;
    job.fill.all.width_mm = 0.35;
    job.fill.all.gap_mm = {0.2};
    job.fill.all.angle_deg = 17;
    const Result<Plan> copies = plan_of(job, Product::kContours);
    ASSERT_TRUE(copies.ok()) << copies.error().message;
    const PartRequest request = job.parts[0];
    job.parts.clear();
    for (const Sections::Area& area : copies->sections->areas()) {
      PartRequest& part = job.parts.emplace_back(request);
      part.copies = 1;
      part.at_mm = {{mm(area.box.lo.x), mm(area.box.lo.y)}};
    }
    const Result<Plan> single = plan_of(job, Product::kContours);
    ASSERT_TRUE(single.ok()) << single.error().message;
    ASSERT_EQ(single->sections->areas().size(), 7u);
    Sections::Work once, each;
    for (std::uint32_t layer = 0; layer < copies->sections->layers().size(); ++layer) {
      ASSERT_TRUE(copies->sections->contours(layer, once));
      ASSERT_TRUE(single->sections->contours(layer, each));
      for (std::uint32_t a = 1; a < 7; ++a) {
        EXPECT_EQ(once.original[a], 0u);
        EXPECT_TRUE(once.outlines[a].walls.empty() && once.outlines[a].region.size() == 0);
        EXPECT_EQ(each.original[a], a);
      }
      const auto bound = copies->sections->fill_bytes_bound(layer, once, {});
      ASSERT_TRUE(bound.ok());
      EXPECT_LE(*bound, *single->sections->fill_bytes_bound(layer, each, {}));
      ASSERT_TRUE(copies->sections->fill(layer, once));
      ASSERT_TRUE(single->sections->fill(layer, each));
      expect_same_paths(once, each, layer);
      EXPECT_GE(*bound, 17 * once.paths.point.size());
    }
  }
}

}  // namespace
}  // namespace lamina::test
