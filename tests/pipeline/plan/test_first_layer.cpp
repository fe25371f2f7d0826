// tests/pipeline/plan/test_first_layer.cpp: a first layer of its own thickness, bead width and outline.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "pipeline/job/file.h"
#include "stages/heights/heights.h"
#include "tests/commands/program.h"
#include "tests/pipeline/plan/plan_of.h"

namespace lamina::test {
namespace {

using namespace pipeline;

TEST(FirstLayer, OfAUniformTableHasItsThickness) {
  const auto table = heights::LayerTable::uniform(1'000'000, 200'000, 300'000);
  ASSERT_EQ(table.size(), 5u);
  EXPECT_EQ(table[0].thickness, 300'000);
  EXPECT_EQ(table[1].bottom, 300'000);
  EXPECT_EQ(table[4].bottom, 900'000);
  EXPECT_EQ(table.top(), 1'100'000);
  EXPECT_EQ(heights::LayerTable::uniform(100'000, 200'000, 300'000).size(), 1u);
  EXPECT_EQ(heights::LayerTable::uniform(1'000'000, 200'000).size(), 5u);
}

class FirstLayerOfJobs : public ::testing::Test {
 protected:
  void SetUp() override { write_box(directory_ / "box.stl", {0, 0, 0}, {20, 20, 2}); }
  Result<Plan> plan(const std::vector<std::string>& keys) {
    Job job;
    job.parts.emplace_back().path = directory_ / "box.stl";
    job.machine.profile = "marlin";
    job.layer_mm = 0.2;
    job.named = {"layers.thickness_mm"};
    job.leave_to_machine = job.dry_run = true;
    for (const std::string& key : keys) EXPECT_TRUE(set_key(job, key).ok()) << key;
    return plan_of(job, Product::kMoves);
  }
  Directory directory_;
};

TEST_F(FirstLayerOfJobs, HasItsWidthAndTheOthersHaveNot) {
  const auto made = plan({"extrude.first_bead_mm=0.5", "extrude.first_thickness_mm=0.3"});
  ASSERT_TRUE(made.ok()) << made.error().message;
  EXPECT_EQ(made->layer_count, 9u) << "the middle of a tenth would be at the top";
  Sections::Work work;
  for (const std::uint32_t layer : {0u, 1u}) {
    ASSERT_TRUE(made->sections->layer(layer, work).ok());
    EXPECT_EQ(work.paths.width[0], layer == 0 ? 500'000 : 400'000);
  }
}

TEST_F(FirstLayerOfJobs, IsMovedInwardsAgainstAnElephantFoot) {
  const auto made = plan({"extrude.elephant_foot_mm=0.15"});
  ASSERT_TRUE(made.ok()) << made.error().message;
  Sections::Work work;
  for (const std::uint32_t layer : {0u, 1u}) {
    ASSERT_TRUE(made->sections->layer(layer, work).ok());
    const auto wall = work.paths.view()[0];
    const auto [low, high] = std::ranges::minmax(wall, {}, &Point2::x);
    EXPECT_EQ(high.x - low.x, layer == 0 ? 19'300'000 : 19'600'000);
  }
}

TEST_F(FirstLayerOfJobs, WithoutAMeaningIsRefused) {
  EXPECT_FALSE(plan({"extrude.first_thickness_mm=0.3", "heights.per_part=true"}).ok());
  EXPECT_FALSE(plan({"extrude.brim_mm=3", "heights.per_part=true"}).ok());
  EXPECT_FALSE(plan({"extrude.first_bead_mm=0.5", "segment.on=true"}).ok());
}

}  // namespace
}  // namespace lamina::test
