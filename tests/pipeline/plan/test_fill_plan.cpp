// tests/pipeline/plan/test_fill_plan.cpp: the filling at each height of each part.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <string_view>
#include <vector>

#include "pipeline/job/keys.h"
#include "pipeline/plan/sections.h"
#include "stages/support/text/toml.h"

namespace lamina::test {
namespace {

pipeline::FillChanges changes_of(std::string_view table) {
  pipeline::FillChanges changes;
  TextPosition at;
  EXPECT_EQ(pipeline::read_fill_changes(*read_toml_value(table), changes, at), "");
  return changes;
}

/// Nine porous layers, then a dense one at 90 degrees, three times: the tomography cylinder of Di Nisio 2022, 3.3.1.
TEST(FillPlan, HeightsAndPartsChangeTheFilling) {
  using namespace pipeline;
  FillRequest request;
  apply(changes_of("{ pattern = 'raster', gap_mm = 0.12, angle_deg = 0, angle_step_deg = 0 }"), request.all);
  const FillChanges dense_there = changes_of("{ gap_mm = 0, angle_deg = 90 }");
  request.ranges = {{2.7, 3, dense_there}, {5.7, 6, dense_there}};
  const auto plan = plan_filling(request, changes_of("{ walls = 2 }"));
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  for (int layer = 0; layer < 29; ++layer) {
    const auto& at = plan->at(layer * 300'000 + 150'000);
    const bool dense = layer == 9 || layer == 19;
    EXPECT_EQ(at.gaps[0], dense ? 0 : 120'000) << layer;
    EXPECT_EQ(at.angle_base, dense ? 90'000'000 : 0) << layer;
    EXPECT_EQ(at.walls, 2u);
  }
  EXPECT_TRUE(plan->fills());
}

TEST(FillPlan, TheOneDirectionToGiveDistancesReplacesTheOneThatHeld) {
  using namespace pipeline;
  FillRequest request;
  apply(changes_of("{ pattern = 'raster', distance_mm = [0.5, 0.7] }"), request.all);
  request.ranges = {{1, 2, changes_of("{ gap_mm = 0.1 }")},
                    {2, 3, changes_of("{ gap_formula = '0.2*z' }")},
                    {3, 4, changes_of("{ gap_by_height = [[0, 0.3]] }")},
                    {4, 5, changes_of("{ angle_deg = 0 }")}};
  const auto plan = plan_filling(request, {});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  EXPECT_EQ(plan->at(500'000).distances, (std::vector<Nm>{500'000, 700'000}));
  EXPECT_EQ(plan->at(4'500'000).distances, (std::vector<Nm>{500'000, 700'000}));
  for (const std::int64_t height : {1'500'000, 2'500'000, 3'500'000}) EXPECT_TRUE(plan->at(height).distances.empty()) << height;
  EXPECT_EQ(plan->at(1'500'000).gaps, std::vector<Nm>{100'000});
  EXPECT_EQ(plan->at(2'500'000).gap_expression, "0.2*z");
  EXPECT_EQ(plan->at(3'500'000).gap_table.size(), 1u);
  const auto own = plan_filling(request, changes_of("{ gap_formula = '0.1' }"));
  ASSERT_TRUE(own.ok()) << own.error().message;
  EXPECT_TRUE(own->at(500'000).distances.empty());
  EXPECT_EQ(own->at(500'000).gap_expression, "0.1");
}

TEST(FillPlan, APatternThatTakesGapsEndsTheDensityOfTheJob) {
  FillRequest request;
  request.all.pattern = infill::Pattern::kGrid;
  request.all.density_percent = 30;
  for (const char* pattern : {"none", "contour", "honeycomb"}) {
    const auto plan = plan_filling(request, changes_of(fmt::format("{{ pattern = '{}' }}", pattern)));
    ASSERT_TRUE(plan.ok()) << pattern;
    EXPECT_FALSE(plan->base.density) << pattern;
  }
  const auto raster = plan_filling(request, changes_of("{ pattern = 'raster' }"));
  ASSERT_TRUE(raster.ok());
  EXPECT_EQ(raster->base.density, 0.3);
}

}  // namespace
}  // namespace lamina::test
