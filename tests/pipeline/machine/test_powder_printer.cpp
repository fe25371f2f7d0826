// What a job asks for, and what follows from it and from its machine.
#include "pipeline/machine/profiles.h"

#include <gtest/gtest.h>

#include "pipeline/job/file.h"
#include "pipeline/plan/plan.h"

namespace lamina::pipeline {
namespace {

using Mm = std::array<double, 2>;

TEST(PowderPrinter, WithoutAMachineTheBedIsTheRequestedOneOrTheBareOne) {
  Job job;
  const auto bare = resolve_powder_printer(job);
  ASSERT_TRUE(bare.ok());
  EXPECT_FALSE(bare->machine);
  EXPECT_FALSE(bare->bed.of_machine);
  EXPECT_EQ(bare->bed.size_mm, kBareBedMm);
  EXPECT_EQ(bare->grid.x.dpi(), 1200);
  job.bed_mm = {100, 50};
  job.dpi = {600, 300};
  const auto requested = resolve_powder_printer(job);
  ASSERT_TRUE(requested.ok());
  EXPECT_EQ(requested->bed.size_mm, (Mm{100, 50}));
  EXPECT_EQ(requested->grid.x.dpi(), 600);
  EXPECT_EQ(requested->grid.y.dpi(), 300);
  job.machine.blocked = {{3}};
  EXPECT_FALSE(resolve_powder_printer(job).ok());
}

TEST(PowderPrinter, AMachineDecidesTheBedAndTheJobStaysAsRequested) {
  Job job;
  job.machine.profile = "nuferbj";
  const auto resolved = resolve(job, Product::kImages);
  ASSERT_TRUE(resolved.ok()) << resolved.error().message;
  EXPECT_TRUE(resolved->bed.of_machine);
  EXPECT_EQ(resolved->bed.size_mm, resolved->printer->machine->machine.bed.size_mm);
  EXPECT_FALSE(resolved->job.bed_mm);
  EXPECT_EQ(canonical_job_text(resolved->job, Product::kImages), canonical_job_text(job, Product::kImages));
  EXPECT_EQ(job_text(resolved->job, "").find("size_mm"), std::string::npos);
  EXPECT_NE(job_text(Job(), "").find("[bed]\nsize_mm = [490, 380]\ndpi = [1200, 1200]\n"), std::string::npos);

  job.bed_mm = resolved->bed.size_mm;
  EXPECT_TRUE(resolve_powder_printer(job).ok());
  EXPECT_NE(job_text(job, "").find("size_mm"), std::string::npos);
  job.bed_mm = {1, 1};
  const auto other = resolve_powder_printer(job);
  ASSERT_FALSE(other.ok());
  EXPECT_TRUE(other.error().message.starts_with("bed.size_mm: the bed of nuferbj is ")) << other.error().message;
}

TEST(PowderPrinter, ToolpathsAreOnTheBedOfTheExtruder) {
  const auto resolved = resolve(Job(), Product::kMoves);
  ASSERT_TRUE(resolved.ok());
  EXPECT_TRUE(resolved->bed.of_machine);
  EXPECT_EQ(resolved->bed.size_mm, resolved->extruder->machine.bed.size_mm);
  EXPECT_FALSE(resolved->printer);
}

}  // namespace
}  // namespace lamina::pipeline
