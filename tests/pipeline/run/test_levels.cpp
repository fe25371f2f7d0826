// Shares of voxels through the plan of a job.
#include <gtest/gtest.h>

#include "pipeline/run/image_maker.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

/// A box of 2 x 3 mm whose top lies in the middle of the third layer, in four levels at 254 dpi.
Result<Plan> plan_of_levels(const std::string& file, std::uint32_t levels) {
  Job job;
  job.parts.push_back({.path = file, .at_mm = std::array{1.0, 1.0}});
  job.bed_mm = {5, 5};
  job.dpi = {254, 254};
  job.layer_mm = 0.1;
  job.levels = levels;
  auto resolved = resolve(job, Product::kImages);
  if (!resolved) return resolved.error();
  return make_plan(std::move(*resolved), [](const ProgressEvent&) {});
}

TEST(Levels, OfEachLayerComeFromThePlan) {
  test::Directory folder;
  test::write_box(folder / "box.stl", {0, 0, 0}, {2, 3, 0.25f});
  const Result<Plan> plan = plan_of_levels(folder / "box.stl", 4);
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  const LayerImager imager(*plan);
  cover::LayerScratch scratch;
  Levels image;
  double volume = 0;
  for (std::uint32_t i = 0; i < plan->layer_count; ++i) {
    const cover::LayerReport report = imager.levels(plan->layer(i), scratch, image);
    volume += report.volume_mm3;
    EXPECT_EQ(image.view().rows(), plan->images->grid.rows());
    // Twenty by thirty voxels: full ones have level 3, those of half a layer round(1.5) = 2.
    EXPECT_EQ(sum_of_levels(image), 20u * 30u * (i < 2 ? 3u : i == 2 ? 2u : 0u));
  }
  EXPECT_NEAR(volume, 2 * 3 * 0.25, 1e-9);
}

TEST(Levels, MoreThanABytesWorthAreRefused) {
  test::Directory folder;
  test::write_box(folder / "box.stl", {0, 0, 0}, {2, 3, 0.25f});
  const Result<Plan> plan = plan_of_levels(folder / "box.stl", 257);
  ASSERT_FALSE(plan.ok());
  EXPECT_EQ(plan.error().fault, Fault::kUsage);
}

}  // namespace
}  // namespace lamina::pipeline
