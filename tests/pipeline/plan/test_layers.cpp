// Layers of a file of contours or toolpaths: each part's own, and steps on one side of the surface.
#include <gtest/gtest.h>

#include <array>
#include <map>
#include <string>

#include "stages/geometry/clipping.h"
#include "tests/pipeline/plan/plan_of.h"

namespace lamina::pipeline {
namespace {

const std::string kNut = LAMINA_TEST_DIR "/corpus/parameter_quality_nut.stl";
const std::string kCrown = LAMINA_TEST_DIR "/corpus/dental_crown.stl";

Job job_of(const std::vector<std::string>& parts) {
  Job job;
  job.dry_run = true;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    PartRequest& part = job.parts.emplace_back();
    part.path = parts[i];
    part.at_mm = {{5 + 60.0 * static_cast<double>(i), 5}};
  }
  job.heights.mode = heights::Mode::kOptimal;
  job.heights.thickness_mm = "0.05..0.3";
  job.heights.cusp_mm = 0.1;
  return job;
}

/// As toolpaths are planned, of which each part may have layers of its own.
Result<Plan> plan_of(const Job& job) { return test::plan_of(job, Product::kMoves); }

double area(const ContoursView& contours) { return square_mm(doubled_area(contours)); }

TEST(LayersOfParts, EachPartIsCutByItsOwnTableAndTopsNeverGoDown) {
  Job job = job_of({kNut, kCrown});
  job.heights.per_part = true;
  job.fill.all.walls = 1;
  const Result<Plan> plan = plan_of(job);
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  std::map<std::uint32_t, std::uint32_t> layers;
  std::map<std::uint32_t, std::int64_t> top;
  std::array<double, 2> mm3{};
  std::int64_t before = 0;
  Sections::Work work;
  for (std::uint32_t i = 0; i < plan->sections->layers().size(); ++i) {
    const ScheduledLayer& scheduled = plan->sections->layers()[i];
    const Layer& layer = scheduled.layer;
    const std::int64_t end = std::int64_t{layer.bottom} + layer.thickness;
    EXPECT_EQ(layer.index, i);
    EXPECT_GE(end, before);
    before = end;
    ASSERT_LT(scheduled.part, 2u);
    EXPECT_EQ(layer.bottom, top[scheduled.part]) << "a gap under layer " << i;
    top[scheduled.part] = end;
    EXPECT_EQ(scheduled.number, layers[scheduled.part]++);
    ASSERT_TRUE(plan->sections->layer(i, work));
    ASSERT_EQ(work.contours.body.size(), 3u);
    const std::uint32_t other = 1 - scheduled.part;
    EXPECT_EQ(work.contours.body[other], work.contours.body[other + 1]) << "layer " << i << " holds the other part";
    EXPECT_EQ(work.path_body[other], work.path_body[other + 1]);
    mm3[scheduled.part] += area(work.contours.contours) * mm(layer.thickness);
  }
  // As many layers as each part gets when it is alone, within the slabs; together they differ.
  EXPECT_NE(layers[0], layers[1]);
  for (std::uint32_t part = 0; part < 2; ++part) {
    const Result<Plan> alone = plan_of(job_of({part == 0 ? kNut : kCrown}));
    ASSERT_TRUE(alone.ok());
    EXPECT_GE(layers[part], alone->sections->layers().size());
    double own_mm3 = 0;
    for (std::uint32_t i = 0; i < alone->sections->layers().size(); ++i) {
      ASSERT_TRUE(alone->sections->layer(i, work));
      own_mm3 += area(work.contours.contours) * mm(alone->sections->layers()[i].layer.thickness);
    }
    EXPECT_NEAR(mm3[part], own_mm3, 0.01 * own_mm3);
    EXPECT_EQ(top[part],
              std::int64_t{alone->sections->layers().back().layer.bottom} + alone->sections->layers().back().layer.thickness);
  }
}

TEST(LayersOfParts, PartsThatTouchShareTheirLayersOrAreRefused) {
  Job job = job_of({kNut, kNut});
  job.parts[1].at_mm = {{10, 5}};
  job.fill.all.walls = 1;
  EXPECT_TRUE(plan_of(job).ok());
  job.heights.per_part = true;
  const Result<Plan> plan = plan_of(job);
  ASSERT_FALSE(plan.ok());
  EXPECT_EQ(plan.error().fault, Fault::kUsage);
  EXPECT_NE(plan.error().message.find("touches another part"), std::string::npos) << plan.error().message;
}

TEST(Containment, StepsOfContoursLieInsideOrOutsideOfBothSectionsOfALayer) {
  Job job = job_of({kCrown});
  job.slice.tolerance_um = 0;  // steps are moved by the tolerance, of either side
  job.heights.cusp_mm = 0.3;
  job.slice.tolerance_um = 0;  // exact
  const Result<Plan> across = plan_of(job);
  job.heights.containment = Containment::kInside;
  const Result<Plan> inside = plan_of(job);
  job.heights.containment = Containment::kOutside;
  const Result<Plan> outside = plan_of(job);
  ASSERT_TRUE(across.ok() && inside.ok() && outside.ok());
  ASSERT_EQ(inside->sections->layers().size(), across->sections->layers().size());
  Sections::Work middle, minimum, maximum;
  double min_mm3 = 0, middle_mm3 = 0, max_mm3 = 0;
  for (std::uint32_t i = 0; i < across->sections->layers().size(); ++i) {
    ASSERT_TRUE(across->sections->layer(i, middle) && inside->sections->layer(i, minimum) &&
                outside->sections->layer(i, maximum));
    const double thickness = mm(across->sections->layers()[i].layer.thickness);
    min_mm3 += area(minimum.contours.contours) * thickness;
    middle_mm3 += area(middle.contours.contours) * thickness;
    max_mm3 += area(maximum.contours.contours) * thickness;
    // What both sections share lies within what either has, to the nanometre that new corners are rounded by.
    const Result<Contours> rest = subtract_contours(minimum.contours.contours, maximum.contours.contours);
    ASSERT_TRUE(rest.ok());
    EXPECT_LT(area(*rest), 1e-4) << "layer " << i;
    // Their sum is that of the two sections.
    slice::SectionScratch scratch;
    slice::LayerContours low, high;
    ASSERT_TRUE(inside->sections->slicer().layer(inside->sections->layers()[i].low, scratch, low).ok());
    ASSERT_TRUE(inside->sections->slicer().layer(inside->sections->layers()[i].high, scratch, high).ok());
    EXPECT_NEAR(area(minimum.contours.contours) + area(maximum.contours.contours), area(low.contours) + area(high.contours),
                1e-3);
  }
  EXPECT_LT(min_mm3, 0.99 * middle_mm3);
  EXPECT_GT(max_mm3, 1.01 * middle_mm3);
}

}  // namespace
}  // namespace lamina::pipeline
