// The memory that a layer's program is reckoned to take, before it is made.
#include <gtest/gtest.h>

#include "pipeline/machine/profiles.h"
#include "pipeline/output/print_program.h"

namespace lamina::pipeline {
namespace {

/// Every pixel set.
Runs full_image(const PixelGrid& grid) {
  Runs runs;
  runs.columns = grid.columns();
  runs.row_offset.push_back(0);
  for (std::uint32_t r = 0; r < grid.rows(); ++r) {
    runs.change.push_back(0);
    runs.change.push_back(runs.columns);
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

TEST(PrintProgramMemory, TextThatFiresAtEachStepStaysWithinTheBound) {
  for (const char* const name : {"reprap-inkjet", "brundlefab"}) {
    for (const bool further : {false, true}) {
      Machine machine = *find_machine(name);
      if (further) machine.head.blocked = {3};
      if (further) machine.head.blocked_rule = BlockedRule::kSecondPass;
      const auto resolved = resolve_profile(machine);
      ASSERT_TRUE(resolved.ok()) << resolved.error().message;
      const Runs image = full_image(resolved->grid.image);
      const PrintProgram program(*resolved, "", 1, {});
      ProgramWork work;
      ProgramRecord record;
      const Status status = program.write_layer({0, 0, 100'000}, image, {0}, work, record);
      ASSERT_TRUE(status.ok()) << status.error().message;
      EXPECT_GT(record.microseconds, 0);
      EXPECT_LE(work.bytes(), program.bytes_bound(image.change.size())) << name << (further ? ", a blocked nozzle" : "");
      EXPECT_GT(work.timer->bytes(), 200'000u) << name << ": too little text for this check";
    }
  }
}

}  // namespace
}  // namespace lamina::pipeline
