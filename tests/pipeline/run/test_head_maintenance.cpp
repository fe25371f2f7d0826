// Jobs of machines with care of head and powder: times, binder and powder by hand, pauses for vats, and the same in shards.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/check/verify.h"
#include "pipeline/job/job.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/run/merge.h"
#include "pipeline/run/run.h"
#include "stages/data/status.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

class HeadMaintenance : public ::testing::Test {
 protected:
  /// nuferbj with more lines; its text ends within [powder].
  std::string profile(const std::string& name, const std::string& lines) const {
    std::string text;
    for (const ShippedProfile& shipped : shipped_machines()) {
      if (shipped.name == "nuferbj") text = shipped.text;
    }
    const std::string path = directory_ / (name + ".toml");
    test::write_text(path, text + lines);
    return path;
  }
  /// A prism of 20 x 10 mm in the middle of the bed, in layers of 0.1 mm.
  Job prism(float height_mm, const std::string& machine, const std::string& out) const {
    const fs::path path = directory_.path() / (out + ".stl");
    test::write_box(path, {0, 0, 0}, {20, 10, height_mm});
    Job job;
    job.parts.emplace_back();
    job.parts[0].path = path.string();
    job.parts[0].at_mm = {39, 44};
    job.machine.profile = machine;
    job.layer_mm = 0.1;
    job.output = directory_ / out;
    return job;
  }
  static Result<Summary> made(const Job& job) {
    const std::atomic<bool> cancel{false};
    return run(
        job, Product::kImages, [](const ProgressEvent&) {}, cancel);
  }
  static Json facts(const Job& job) {
    const auto summary = made(job);
    EXPECT_TRUE(summary.ok()) << (summary.ok() ? "" : summary.error().message);
    return summary.ok() ? summary->facts : Json();
  }
  static VerifyReport verified(const Job& job) {
    auto report = verify(job.output, {});
    EXPECT_TRUE(report.ok() && report->ok()) << (report.ok() && !report->faults.empty() ? report->faults[0] : job.output);
    return report.ok() ? std::move(*report) : VerifyReport();
  }
  test::Directory directory_;
};

// A layer of nuferbj takes 9.807 s (PrintTimes.NuferbjOfTwoHeightsByHand). With care, 30 layers:
//   base   5 layers of 0.2 mm: vat 0.2 / 5 = 0.04 s, feed 0.25 / 5 = 0.05, roller 8.667: 43.783 s
//   shots  850 at 4250 Hz are 0.2 s; (0, 0) to (-40, 5) 40.31 mm and to (95.81, 70.74) 150.88, instead of 119.1, at 400 mm/s:
//          0.380 s a layer
//   wiper  every tenth layer (0, 0) to (-40, 20) 44.72 mm and (-40, 60) to (-40, 5) 55, instead of 40.31, and 40 mm at 50 mm/s:
//          0.949 s, thrice
//   pause  1.5 s a layer where the head waits anyway
//   all    30 (9.807 + 0.380 + 1.5) + 43.783 + 3 x 0.949 = 397.24 s
TEST_F(HeadMaintenance, TimeBinderAndPowderByHand) {
  const Job job =
      prism(3,
            profile("maintenance",
                    "base_layers = 5\nbase_layer_mm = 0.2\ndry_s = 1.5\n[maintenance]\nspit_layers = 1\nspit_drops = 850\n"
                    "spit_mm = [-40, 5]\nwipe_layers = 10\nwipe_mm = [-40, 20, -40, 60]\n"),
            "maintenance");
  Job dry = job;
  dry.dry_run = true;
  const auto reported = facts(dry), done = facts(job);
  EXPECT_NEAR(reported["print_seconds"].get<double>(), 397.24, 0.4);
  EXPECT_EQ(reported["print_seconds"], done["print_seconds"]);
  const VerifyReport report = verified(job);
  EXPECT_EQ(report.replay.seconds(), done["print_seconds"].get<double>());
  EXPECT_EQ(report.replay.spits, 30u);
  EXPECT_EQ(report.replay.wipes, 3u);
  EXPECT_EQ(report.replay.spat, 30u * 850 * 128);
  // Drops of 50 pl; layers of 3 mm and the base of 1, fed 1.25 times, of a bed of 98 mm across.
  const double drops = static_cast<double>(report.replay.drops) + 30 * 850 * 128.0;
  EXPECT_NEAR(report.material.binder_mm3, drops * 50e-6, 1e-9);
  EXPECT_NEAR(done["use"]["binder_mm3"].get<double>(), drops * 50e-6, 1e-3);
  EXPECT_NEAR(report.replay.fed_mm[0], 1.25 * 4, 1e-9);
  EXPECT_NEAR(done["use"]["powder_fed_mm3"].get<double>(), 1.25 * 4 * 3.14159265358979 * 49 * 49, 0.1);
}

// A vat of 1000 mm2 for a bed of 7543: the dose is 7.543 times as high for the same powder.
TEST_F(HeadMaintenance, PowderIsCountedByTheAreaOfTheVats) {
  Job job = prism(1, profile("narrow", "vat_area_mm2 = 1000\n"), "narrow");
  const auto fed = facts(job)["use"]["powder_fed_mm3"].get<double>();
  EXPECT_NEAR(fed, 1.25 * 1000, 0.01);
  EXPECT_NEAR(verified(job).material.powder_mm3, 1.25 * 1000 * 0.6, 1e-6);
}

// Each layer takes 0.125 mm of the vat: 3 mm of part 3.75. A vat of 1.5 mm lasts for 12 layers.
TEST_F(HeadMaintenance, AVatThatRunsEmptyRefusesTheJobBeforeItStartsOrIsFilledInPauses) {
  const Job refused = prism(3, profile("shallow", "vat_depth_mm = [1.5, 0]\n"), "refused");
  const auto none = made(refused);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().fault, Fault::kUsage);
  EXPECT_NE(none.error().message.find("layer 12 (z 1.200 mm): the first vat of nuferbj, 1.5 mm deep, is empty for it: the job "
                                      "takes 3.75 mm"),
            std::string::npos)
      << none.error().message;
  EXPECT_FALSE(fs::exists(refused.output));
  EXPECT_TRUE(made(prism(1.2F, profile("shallow", "vat_depth_mm = [1.5, 0]\n"), "low")).ok());

  Job pauses =
      prism(3, profile("pauses", "vat_depth_mm = [1.5, 0]\nrefill = \"pause\"\n[maintenance]\ncap_mm = [-40, 5]\n"), "pauses");
  EXPECT_EQ(facts(pauses)["refills"], Json({12, 24}));
  EXPECT_EQ(verified(pauses).replay.refills, 2u);
  EXPECT_NE(test::read_text(fs::path(pauses.output) / "program/000012.gcode").find("\nM815\n"), std::string::npos);
  const std::string whole = test::read_text(fs::path(pauses.output) / "program/000024.gcode");
  pauses.output = directory_ / "shards";
  const Json own[] = {Json::array(), Json::array({12}), Json::array({24})};
  for (std::uint32_t i = 0; i < 3; ++i) {
    pauses.shard = {{i, 3}};
    EXPECT_EQ(facts(pauses)["refills"], own[i]) << "those of its own layers";
  }
  EXPECT_EQ(verified(pauses).replay.refills, 2u) << "shards that are not merged are one job";
  // Vats are carried from one to the next: the second one's pause left out empties the vat that the first has left.
  {
    const fs::path layer = fs::path(pauses.output) / "program/000012.gcode";
    const std::string good = test::read_text(layer);
    std::string text = good;
    text.erase(text.find("M815\n"), 5);
    test::write_text(layer, text);
    const auto report = verify(pauses.output, {});
    ASSERT_TRUE(report.ok());
    EXPECT_TRUE(std::ranges::any_of(report->faults, [](const std::string& fault) {
      return fault.find("layer 12: takes 0.125 mm of the first vat, where 0 of 1.5 are left") != std::string::npos;
    }));
    test::write_text(layer, good);
  }
  ASSERT_TRUE(merge({.directories = {pauses.output}, .output = pauses.output}).ok());
  verified(pauses);
  EXPECT_EQ(test::read_text(fs::path(pauses.output) / "program/000024.gcode"), whole);

  // A program that leaves a pause out empties the vat, regardless of its hash.
  const fs::path layer = fs::path(pauses.output) / "program/000012.gcode";
  std::string text = test::read_text(layer);
  text.erase(text.find("M815\n"), 5);
  test::write_text(layer, text);
  const auto report = verify(pauses.output, {});
  ASSERT_TRUE(report.ok());
  std::string faults;
  for (const std::string& fault : report->faults) faults += fault + "\n";
  EXPECT_NE(faults.find("layer 12: takes 0.125 mm of the first vat, where 0 of 1.5 are left"), std::string::npos) << faults;
}

TEST_F(HeadMaintenance, JobsOfOnePowderAreFedByOneVat) {
  const Job job = prism(0.3F, profile("one", ""), "one");
  ASSERT_TRUE(made(job).ok());
  verified(job);
  const fs::path layer = fs::path(job.output) / "program/000001.gcode";
  std::string text = test::read_text(layer);
  const std::size_t feeds = text.find("G1 A");
  ASSERT_NE(feeds, std::string::npos);
  text[feeds + 3] = 'B';
  test::write_text(layer, text);
  const auto report = verify(job.output, {});
  ASSERT_TRUE(report.ok());
  EXPECT_TRUE(std::ranges::any_of(report->faults, [](const std::string& fault) {
    return fault.find("both vats feed, but the job uses one powder") != std::string::npos;
  }));
}

TEST_F(HeadMaintenance, PositionsWithoutATimeForThemGiveAWarning) {
  Job job = prism(0.3F, profile("idle", "[maintenance]\nspit_mm = [-40, 5]\nwipe_mm = [-40, 20, -40, 60]\ncap_mm = [-40, 5]\n"),
                  "idle");
  job.dry_run = true;
  const auto summary = made(job);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  ASSERT_EQ(summary->warnings.size(), 1u);
  EXPECT_EQ(summary->warnings[0].code, "maintenance");
  for (const char* what :
       {"no shot: maintenance.spit_layers", "no wipe: maintenance.wipe_layers", "no pause under maintenance.cap_mm"})
    EXPECT_NE(summary->warnings[0].text.find(what), std::string::npos) << summary->warnings[0].text;
}

// Of two powders pixels decide which vat feeds, and so which one is empty, and when: bronze from 1 mm on, in the second vat.
TEST_F(HeadMaintenance, TheSecondVatIsEmptiedByTheLayersThatItFeeds) {
  const auto two = [&](const std::string& name, const std::string& depths) {
    Job job = prism(3, profile(name, depths), name);
    job.parts[0].material = "steel";
    job.parts[0].material_ranges = {{1, 3, "bronze"}};
    return job;
  };
  EXPECT_TRUE(made(two("enough", "vat_depth_mm = [1.25, 2.5]\n")).ok());
  const auto first = made(two("first", "vat_depth_mm = [1.2, 2.5]\n")),
             second = made(two("second", "vat_depth_mm = [1.25, 2.4]\n"));
  ASSERT_FALSE(first.ok() || second.ok());
  EXPECT_NE(first.error().message.find("layer 9 (z 0.900 mm): the first vat"), std::string::npos) << first.error().message;
  EXPECT_NE(second.error().message.find("layer 29 (z 2.900 mm): the second vat"), std::string::npos) << second.error().message;
  Job pauses = two("both", "vat_depth_mm = [1.25, 1.25]\nrefill = \"pause\"\n");
  EXPECT_EQ(facts(pauses)["refills"], Json::array({20}));
  EXPECT_EQ(verified(pauses).replay.refills, 1u);
}

}  // namespace
}  // namespace lamina::pipeline
