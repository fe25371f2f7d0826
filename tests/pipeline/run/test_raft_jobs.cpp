// tests/pipeline/run/test_raft_jobs.cpp: parts on a raft are those without one, lifted.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "stages/formats/gcode/read_gcode.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

class RaftJobs : public ::testing::Test {
 protected:
  void SetUp() override { write_box(folder_ / "box.stl", {0, 0, 0}, {20, 20, 2}); }
  Outcome run(const std::string& line) const { return run_lamina(words_of(line), folder_.path()); }
  Directory folder_;
};

TEST_F(RaftJobs, LiftTheParts) {
  const std::string job = "extrude box.stl --machine marlin --layer 0.2 --skirt 0 --json ";
  ASSERT_EQ(run(job + "-o plain.gcode").code, 0);
  const Outcome made = run(job + "--raft 3 --raft-gap 0.15 --first-layer 0.3 -o raft.gcode");
  ASSERT_EQ(made.code, 0) << made.err;
  const auto plain = formats::GcodeFile::open(folder_ / "plain.gcode"), raft = formats::GcodeFile::open(folder_ / "raft.gcode");
  ASSERT_TRUE(plain.ok() && raft.ok());
  ASSERT_EQ(plain->count(), 10u);
  ASSERT_EQ(raft->count(), 13u);
  const std::int64_t tops[] = {300'000, 500'000, 700'000};
  for (std::uint32_t i = 0; i < 3; ++i) {
    const auto layer = raft->layer(i);
    ASSERT_TRUE(layer.ok());
    EXPECT_EQ(layer->z, tops[i]);
    for (const auto& bead : layer->beads) ASSERT_EQ(raft->types()[bead.type], "Support material");
  }
  for (std::uint32_t i = 0; i < 10; ++i) {
    const auto on_raft = raft->layer(3 + i), on_bed = plain->layer(i);
    ASSERT_TRUE(on_raft.ok() && on_bed.ok());
    EXPECT_EQ(on_raft->z, on_bed->z + 850'000);
    ASSERT_EQ(on_raft->beads.size(), on_bed->beads.size());
    for (std::size_t b = 0; b < on_bed->beads.size(); ++b) {
      EXPECT_EQ(on_raft->beads[b].from, on_bed->beads[b].from);
      EXPECT_EQ(on_raft->beads[b].width, on_bed->beads[b].width);
    }
  }
  // The raft is not of the parts, and its time and filament count.
  const auto json = nlohmann::json::parse(made.out);
  EXPECT_NEAR(json.at("skirt").at("volume_mm3"), 26 * 26 * (0.3 * 0.9 + 0.2 * 0.5 + 0.2), 15);
  EXPECT_EQ(json.at("raft").at("lift_mm"), 0.85);
  EXPECT_EQ(run("verify raft.gcode --model box.stl").code, 0);
  const Outcome report = run("report raft.gcode -o report.html");
  EXPECT_EQ(report.code, 0) << report.err;
}

TEST_F(RaftJobs, HaveTheSameBytesWithMoreThreads) {
  const std::string job = "extrude box.stl --machine marlin --layer 0.2 --raft 2 --machine-set code.progress=true ";
  ASSERT_EQ(run(job + "--threads 1 -o one.gcode").code, 0);
  ASSERT_EQ(run(job + "--threads 4 -o four.gcode").code, 0);
  const std::string text = read_text(folder_ / "one.gcode");
  EXPECT_EQ(text, read_text(folder_ / "four.gcode"));
  // Each layer of the file states the time that is over, increasing.
  int last = -1, count = 0;
  for (std::size_t at = 0; (at = text.find("M73 P", at)) != std::string::npos; ++at, ++count) {
    const int percent = std::stoi(text.substr(at + 5));
    EXPECT_GT(percent, last);
    last = percent;
  }
  EXPECT_EQ(count, 13) << "12 layers and the end";
}

TEST_F(RaftJobs, WithoutAMeaningAreRefused) {
  const std::string job = "extrude box.stl --layer 0.2 -o r.gcode --raft 2 ";
  expect_refused(job + "--machine marlin --brim 3", 2, "brim", folder_);
  expect_refused(job + "--machine marlin --layers 1:", 2, "--layers", folder_);
  expect_refused(job + "--machine fdm-2000", 2, "SML", folder_);
  expect_refused(job + "--machine marlin --first-layer 0.8", 2, "thicker than the nozzle", folder_);
  expect_refused(job + "--machine marlin --bottom 3", 2, "3 mm above the bed", folder_);
  expect_refused(job + "--machine marlin --machine-set bed.build_height_mm=2.3", 2, "on a raft of 0.500 mm", folder_);
}

}  // namespace
}  // namespace lamina::test
