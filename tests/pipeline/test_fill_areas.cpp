// tests/pipeline/test_fill_areas.cpp: parts that touch or overlap are filled each by its own parameters, in its own room.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/slice.h"
#include "stages/data/clipping.h"
#include "tests/pipeline/program.h"
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
void expect_within(const SlicePlan::Work& work, std::size_t a, const ContoursView& room, Nm width, PathKind kind) {
  const ToolpathsView paths = work.paths;
  std::size_t seen = 0;
  for (std::uint32_t p = work.path_area[a]; p < work.path_area[a + 1]; ++p) {
    for (std::uint32_t i = paths.offset[p]; i + 1 < paths.offset[p + 1]; ++i) {
      EXPECT_EQ(paths.width[i], width);
      seen += paths.kind[i] == kind ? 1 : 0;
      for (int k = 0; k <= 8; ++k) {
        const double x = paths.point[i].x + (static_cast<double>(paths.point[i + 1].x) - paths.point[i].x) * k / 8;
        const double y = paths.point[i].y + (static_cast<double>(paths.point[i + 1].y) - paths.point[i].y) * k / 8;
        ASSERT_EQ(winding_about(room, {static_cast<Nm>(std::llround(x)), static_cast<Nm>(std::llround(y))}), 1) << "area " << a;
        ASSERT_GE(distance_to(room, x, y), width / 2 - 2) << "area " << a;
      }
    }
  }
  EXPECT_GT(seen, 3u) << "area " << a;
}

class FillAreas : public ::testing::Test {
 protected:
  Result<SlicePlan> plan_of(const std::vector<Placed>& parts, const std::string& by_height = {}) {
    Job job;
    job.layer_mm = 0.5;
    job.fill.all.walls = 1;
    job.fill.by_height = by_height;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      PartRequest part;
      part.path = directory_ / ("part" + std::to_string(i) + ".stl");
      const auto& size = parts[i].size;
      write_box(part.path, {0, 0, 0}, {static_cast<float>(size[0]), static_cast<float>(size[1]), static_cast<float>(size[2])});
      part.at_mm = {parts[i].at[0], parts[i].at[1]};
      part.bottom_mm = parts[i].at[2];
      part.fill = parts[i].fill;
      job.parts.push_back(part);
    }
    return SlicePlan::make(job, [](const ProgressEvent&) {});
  }
  Directory directory_;
};

TEST_F(FillAreas, PartsWhoseBoxesTouchKeepTheirOwnFillingAndHeights) {
  const auto plan = plan_of({{{20, 20, 0}, {20, 20, 4}, "pattern=raster angle_deg=0 width_mm=0.4"},
                             {{40, 20, 1}, {20, 20, 4}, "pattern=contour width_mm=0.6"}}, "2:3 gap_mm=0.5");
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  ASSERT_EQ(plan->areas().size(), 2u);
  for (std::uint32_t layer = 0; layer < plan->layers().size(); ++layer) {
    // Each by the height above its own bottom.
    for (const auto& area : plan->areas()) {
      const double z = mm(plan->layers()[layer].layer.plane() - area.box.lo.z);
      EXPECT_EQ(plan->filling(area, plan->layers()[layer].layer).gaps[0], z >= 2 && z < 3 ? 500'000 : 0) << layer;
    }
  }
  SlicePlan::Work work;
  ASSERT_TRUE(plan->layer(4, work).ok());  // z 2.25: both are solid
  EXPECT_EQ(work.contours.contours.size(), 1u) << "contours are united";
  EXPECT_NEAR(square_mm(doubled_area(work.contours.contours)), 800, 1e-9);
  expect_within(work, 0, rectangle(20, 20, 40, 40), 400'000, PathKind::kRaster);
  expect_within(work, 1, rectangle(40, 20, 60, 40), 600'000, PathKind::kContour);
}

TEST_F(FillAreas, SharedRoomBelongsToTheFirstPart) {
  const auto plan = plan_of({{{20, 20, 0}, {20, 20, 4}, "pattern=raster width_mm=0.4 gap_mm=0.3"},
                             {{30, 25, 0}, {20, 20, 4}, "pattern=contour+raster width_mm=0.5"},
                             {{25, 35, 0}, {8, 30, 4}, "pattern=honeycomb width_mm=0.3 cell_mm=3"}});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  SlicePlan::Work work;
  ASSERT_TRUE(plan->layer(3, work).ok());
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

TEST_F(FillAreas, WhatFollowsTheCountOfPointsIsWithinIt) {
  const auto plan = plan_of({{{20, 20, 0}, {20, 20, 4}, "pattern=raster width_mm=0.02"},
                             {{40, 20, 0}, {20, 20, 4}, "pattern=quatrefoil width_mm=0.1 gap_mm=0.1 cell_mm=0.3"},
                             {{70, 20, 0}, {20, 20, 4}, "pattern=contour width_mm=0.02"}});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  SlicePlan::Work work;
  ASSERT_TRUE(plan->contours(2, work).ok());
  const auto bound = plan->fill_bytes_bound(2, work, 0);
  ASSERT_TRUE(bound.ok());
  const std::uint64_t before = work.bytes();
  ASSERT_TRUE(plan->fill(2, work).ok());
  EXPECT_GT(work.paths.point.size(), 50'000u);
  EXPECT_LE(work.bytes(), before + *bound);
}

}  // namespace
}  // namespace lamina::test
