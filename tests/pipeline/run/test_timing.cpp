// tests/pipeline/run/test_timing.cpp: where the time of a run goes, and the least that it could be.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pipeline/run/timing.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

// Amdahl: a share s alone and the rest on n threads take s + (1 - s) / n of the time of one.
TEST(Timing, TheShareOfOneThreadFollowsFromWallAndProcessor) {
  for (const double share : {0.0, 0.25, 1.0}) {
    const double work = 8, wall = work * (share + (1 - share) / 4);
    // Of the wall time, that of the serial part.
    EXPECT_NEAR(serial_share({wall, work}, 4), work * share / wall, 1e-12) << share;
  }
  EXPECT_EQ(serial_share({2, 1}, 1), 0);
  EXPECT_EQ(serial_share({0, 0}, 4), 0);
  EXPECT_EQ(serial_share({1, 5}, 4), 0) << "clocks that differ a little";
}

TEST(Timing, TheLimitReadsThePartsAndLeavesNothing) {
  const test::Directory folder;
  test::write_text(folder / "part.stl", std::string(1000, 'x'));
  write::Floor floor;
  floor.bytes_written = 1001;
  floor.files = 3;
  floor.crossings = 100;
  const Status status = write::measure_floor({folder / "part.stl"}, folder / "out", floor);
  ASSERT_TRUE(status.ok()) << status.error().message;
  EXPECT_EQ(floor.bytes_read, 1000u);
  EXPECT_GT(floor.write, 0);
  EXPECT_EQ(test::files_below(folder.path()).size(), 1u);
}

TEST(Timing, ALimitThatWasNotMeasuredHasNoNumbers) {
  Timing timing;
  timing.phases = {{"layers", {2, 3}}};
  timing.floor.bytes_written = 10;
  const test::Directory folder;
  timing.not_measured = write::measure_floor({folder / "missing.stl"}, folder / "out", timing.floor).error().message;
  EXPECT_NE(timing.not_measured.find("missing.stl: "), std::string::npos);
  const nlohmann::ordered_json limit = timing_json(timing)["limit"];
  EXPECT_EQ(limit.size(), 1u) << limit;
  EXPECT_EQ(limit.value("not_measured", ""), timing.not_measured);
  bool told = false;
  for (const auto& [label, line] : timing_lines(timing)) {
    told |= line.find("not measured: ") != std::string::npos;
    EXPECT_EQ(line.find("times the limit"), std::string::npos) << line;
  }
  EXPECT_TRUE(told);
}

}  // namespace
}  // namespace lamina::pipeline
