// How long machines take: by hand, and the same from dry run, run, replay, shards and resumed runs.
#include <gtest/gtest.h>

#include <filesystem>

#include "pipeline/check/verify.h"
#include "pipeline/machine/profiles.h"
#include "pipeline/run/merge.h"
#include "pipeline/run/run.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

class PrintTimes : public ::testing::Test {
 protected:
  /// A box of these sides with its lower corner there.
  Job prism(std::array<float, 3> size, std::array<double, 2> at_mm, const std::string& machine, double layer_mm,
            const std::string& out) {
    const fs::path path = directory_.path() / (out + ".stl");
    test::write_box(path, {0, 0, 0}, size);
    Job job;
    job.parts.emplace_back();
    job.parts[0].path = path.string();
    job.parts[0].at_mm = at_mm;
    job.machine.profile = machine;
    job.layer_mm = layer_mm;
    job.output = (directory_.path() / out).string();
    return job;
  }
  static double print_seconds(const Job& job) {
    const std::atomic<bool> cancel{false};
    const auto summary = run(
        job, Product::kImages, [](const ProgressEvent&) {}, cancel);
    EXPECT_TRUE(summary.ok()) << job.machine.profile << ": " << (summary.ok() ? "" : summary.error().message);
    return summary.ok() ? summary->facts["print_seconds"].get<double>() : 0;
  }
  /// Leaves the time of layer 1 out of the manifest, as builds did that did not know it.
  static void forget_a_time(const Job& job) {
    const fs::path manifest = fs::path(job.output) / "manifest.json";
    std::string text = test::read_text(manifest);
    const std::size_t at = text.find("\"microseconds\"", text.find("\"index\": 1"));
    ASSERT_NE(at, std::string::npos);
    const std::size_t comma = text.rfind(',', at);
    text.erase(comma, text.find_first_of(",}\n", at) - comma);
    test::write_text(manifest, text);
  }
  static double dry_seconds(Job job) {
    job.dry_run = true;
    return print_seconds(job);
  }
  static double replayed_seconds(const Job& job) {
    const auto report = verify(job.output, {});
    EXPECT_TRUE(report.ok() && report->ok()) << (report.ok() && !report->faults.empty() ? report->faults[0] : job.output);
    return report.ok() ? report->replay.seconds() : 0;
  }
  test::Directory directory_;
};

// nuferbj, a layer of 0.1 mm. Pixels of 137.1 sin 45 = 96.944 um; lines count from the back, 98.011 mm.
//   powder   vat 0.1 / 5 = 0.020 s, feed 0.125 / 5 = 0.025, roller 2 x 260 / 60 = 8.667: 8.712 s
//   lines    y 44 to 54 are lines 454 to 556: nozzles 70 to 127 of the swath at line 384, 0 to 44 of that at 512
//   columns  x 39 to 59 are 402 to 608; nozzle i lags i of them: steps 472 to 735, and 402 to 652
//   sweeps   263 and 250 steps are 25.50 and 24.24 mm, and 2 x 10 of ramps, at 300 mm/s: 0.152 + 0.147 s
//   carriage bed + (60, 10): from (0, 0) to (95.81, 70.74) 119.1 mm, from (141.30, 70.74) to (89.02, 58.33) 53.7,
//            from (133.26, 58.33) back 145.5, at 400 mm/s: 0.298 + 0.134 + 0.364 s
//   a layer  8.712 + 0.299 + 0.796 = 9.807 s
TEST_F(PrintTimes, NuferbjOfTwoHeightsByHand) {
  const Job low = prism({20, 10, 3}, {39, 44}, "nuferbj", 0.1, "low"),
            high = prism({20, 10, 6}, {39, 44}, "nuferbj", 0.1, "high");
  const double thirty = print_seconds(low), sixty = print_seconds(high);
  EXPECT_NEAR(thirty, 30 * 9.807, 0.002 * thirty);
  EXPECT_NEAR(sixty, 60 * 9.807, 0.002 * sixty);
  EXPECT_NEAR(sixty, 2 * thirty, 1e-9 * sixty);
  EXPECT_EQ(replayed_seconds(low), thirty);
  EXPECT_EQ(replayed_seconds(high), sixty);
}

// production-1200, whose programs hold planes alone; a layer of 0.05 mm. Pixels of 21.1667 um, rows of nozzles 60 apart.
//   powder   (1 + 1.3) 0.05 / 5 = 0.023 s, roller 2 x 900 / 150 = 12: 12.023 s, by the profile
//   lines    y 180 to 220 are lines 8504 to 10393 from the back: swaths at 8000, 9000, 10000
//   columns  8504 to 10393, the last row lags 180: 2069 steps are 43.79 mm, and 2 x 40 of ramps, at 800 mm/s: 0.1547 s, thrice
//   travel   from (0, 0) to (140.01, 230.66) 269.8 mm; the second sweep runs back, so that only 21.17 mm lie between two; from
//            (263.81, 188.33) back 324.1; at 1000 mm/s: 0.270 + 2 x 0.021 + 0.324 = 0.636 s
//   a layer  12.023 + 0.464 + 0.636 = 13.123 s
TEST_F(PrintTimes, PlanesInBothDirectionsByHand) {
  const Job job = prism({40, 40, 0.5}, {180, 180}, "production-1200", 0.05, "planes");
  const double ten = print_seconds(job);
  EXPECT_NEAR(ten, 10 * 13.123, 0.002 * ten);
  EXPECT_EQ(replayed_seconds(job), ten);
}

// xaar128-raw, a layer of 0.1 mm. Lines of 137.1 sin 22.79 = 53.107 um from the front, ticks of 17.639 um from the right.
//   powder   (1 + 1.2) 0.1 / 5 = 0.044 s, roller 2 x 300 / 60 = 10: 10.044 s, by the profile
//   lines    y 80 to 90 are lines 1506 to 1694; the first swath begins there, the second at 1634 with nozzles 0 to 60
//   columns  x 110 to 90 are 1701 to 2078 from the right, three ticks each; nozzle 127 leads, nozzle i lags (127 - i) 7.1658
//            ticks: ticks 5103 to 7144, and 5583 to 7144
//   sweeps   2041 and 1561 ticks are 36.00 and 27.53 mm, and 2 x 5 of ramps, at 150 mm/s: 0.307 + 0.250 s
//   travel   from (0, 0) to (114.99, 80.01) 140.1 mm, from (68.99, 80.01) to (106.52, 86.80) 38.1, from (68.99, 86.80) back
//            110.9, at 200 mm/s: 0.700 + 0.191 + 0.554 s
//   a layer  10.044 + 0.557 + 1.445 = 12.046 s
TEST_F(PrintTimes, RawWordsFromTheRightByHand) {
  const Job job = prism({20, 10, 2}, {90, 80}, "xaar128-raw", 0.1, "raw");
  const double twenty = print_seconds(job);
  EXPECT_NEAR(twenty, 20 * 12.046, 0.002 * twenty);
  EXPECT_EQ(replayed_seconds(job), twenty);
}

// reprap-inkjet, whose head stops at each pixel: a way of d takes 2 sqrt(d / a) where it is shorter than v^2 / a, else
// d / v + v / a, with a = 500 mm/s2. A layer of 0.1 mm; pixels of 0.26458 mm.
//   powder   0.1 / 5 = 0.020 s, 0.12 / 5 = 0.024, roller 2 x 300 / 50 = 12: 12.044 s
//   lines    y 100 to 103 are lines 367 to 377 from the back: swaths of 12 at 360 and 372
//   sweeps   columns 378 to 415: a ramp of 2 mm 0.1265 s, 37 times a pixel 0.04601, a ramp: 1.955 s, twice
//   travel   at 120 mm/s from (0, 0) to (98.15, 104.64) 143.5 mm: 1.436 s; from (111.93, 104.64) to (98.15, 101.47) 14.15 mm:
//            0.336; from (111.93, 101.47) back 151.1 mm: 1.499
//   nozzles  one after the other, 5 + 800 us each (Platform::Inkjet): 38 x 11 drops are 0.336 s
//   a layer  12.044 + 3.910 + 3.271 + 0.336 = 19.561 s
TEST_F(PrintTimes, AHeadThatStopsAtEachPixelByHand) {
  const Job job = prism({10, 3, 1}, {100, 100}, "reprap-inkjet", 0.1, "stops");
  const double ten = print_seconds(job);
  EXPECT_NEAR(ten, 10 * 19.561, 0.002 * ten);
  EXPECT_EQ(replayed_seconds(job), ten);
}

// hp45, a layer of 0.1 mm. Pixels of 42.333 um, carriage bed + (20, 20).
//   powder   0.1 / 5 = 0.020 s, 0.15 / 5 = 0.030, roller 2 x 230 / 50 = 9.2: 9.250 s
//   lines    y 46 to 54 are in the swaths of 300 lines at 900 and 1200 from the back, each jetted twice, since ten nozzles
//            are blocked: a nozzle further along comes to their lines, y 0.042 mm on
//   sweeps   12 mm, 238 counts of run-up (8 mm of ramp, half of the 4.05 mm between the rows, a step) 10.09, behind the last
//            row 10.03: 32.12 mm at 250 mm/s: 0.1285 s, four times
//   travel   from (0, 0) to (53.91, 81.91) 98.06 mm, back to the beginning 32.12, to the next swath 34.56, back 32.12, from
//            (86.03, 69.25) to the safe place 110.44, at 250 mm/s: 1.229 s
//   a layer  9.250 + 0.514 + 1.229 = 10.993 s
TEST_F(PrintTimes, Hp45ByHand) {
  const Job job = prism({12, 8, 1}, {44, 46}, "hp45", 0.1, "hp45");
  const double ten = print_seconds(job);
  EXPECT_NEAR(ten, 10 * 10.993, 0.002 * ten);
  EXPECT_EQ(replayed_seconds(job), ten);
}

// The profile says what no program can: 4 s of drying a layer, and a recoater of 9 s instead of 12.023.
TEST_F(PrintTimes, PausesAndSpreadingByTheProfileByHand) {
  std::string text;
  for (const ShippedProfile& shipped : shipped_machines()) {
    if (shipped.name == "production-1200") text = shipped.text;
  }
  const fs::path profile = directory_.path() / "dries.toml";
  test::write_text(profile, text + "pause_s = 4\nspread_s = 9\n");
  const double ten = dry_seconds(prism({40, 40, 0.5}, {180, 180}, profile.string(), 0.05, "dries"));
  EXPECT_NEAR(ten, 10 * (13.123 - 12.023 + 9 + 4), 0.002 * ten);
}

TEST_F(PrintTimes, APrismsTimeIsLinearInItsHeightOnEveryMachineHoweverItIsStated) {
  for (const ShippedProfile& shipped : shipped_machines()) {
    const std::string name(shipped.name);
    SCOPED_TRACE(name);
    const Job once = prism({12, 8, 2}, {30, 40}, name, 1, name + "-1");
    const double reported = dry_seconds(once);
    EXPECT_GT(reported, 2);
    EXPECT_FALSE(fs::exists(once.output)) << "a dry run writes nothing";
    for (const int times : {2, 7}) {
      Job more = prism({12, 8, 2.0f * static_cast<float>(times)}, {30, 40}, name, 1, name + "-n");
      EXPECT_NEAR(dry_seconds(more), times * reported, 1e-6 * times * reported) << times;
    }
    EXPECT_EQ(print_seconds(once), reported);
    EXPECT_EQ(replayed_seconds(once), reported);
  }
}

TEST_F(PrintTimes, SharesAddUpToTheWholeAndResumedRunsReportAllOfIt) {
  Job whole = prism({12, 8, 9}, {30, 40}, "nuferbj-31", 1, "whole");
  const double all = print_seconds(whole);
  EXPECT_EQ(replayed_seconds(whole), all);
  Job share = whole;
  share.output = (directory_.path() / "shares").string();
  double sum = 0;
  for (std::uint32_t i = 0; i < 4; ++i) {
    share.shard = {{i, 4}};
    const double own = print_seconds(share);
    EXPECT_NEAR(dry_seconds(share), own, 0);
    sum += own;
  }
  EXPECT_NEAR(sum, all, 1e-9 * all);
  const auto merged = merge({.directories = {share.output}, .output = share.output});
  ASSERT_TRUE(merged.ok());
  EXPECT_NEAR(static_cast<double>(merged->microseconds) * 1e-6, all, 1e-9 * all);
  EXPECT_EQ(replayed_seconds(share), all);
  forget_a_time(share);
  EXPECT_FALSE(merge({.directories = {share.output}, .output = share.output}).ok())
      << "a sum of some layers is no time of the job";
  fs::remove(fs::path(whole.output) / "program/000003.gcode");
  whole.resume = true;
  EXPECT_EQ(print_seconds(whole), all);
  forget_a_time(whole);
  const std::atomic<bool> cancel{false};
  const auto resumed = run(
      whole, Product::kImages, [](const ProgressEvent&) {}, cancel);
  EXPECT_FALSE(resumed.ok());
}

TEST_F(PrintTimes, AManifestThatStatesAnotherTimeIsAFault) {
  const Job job = prism({12, 8, 3}, {30, 40}, "xaar128-raw", 1, "stated");
  print_seconds(job);
  const fs::path manifest = fs::path(job.output) / "manifest.json";
  std::string text = test::read_text(manifest);
  const std::size_t at = text.find("\"microseconds\": ", text.find("\"index\": 1"));
  ASSERT_NE(at, std::string::npos);
  text.insert(at + 16, "1");
  test::write_text(manifest, text);
  const auto report = verify(job.output, {});
  ASSERT_TRUE(report.ok());
  ASSERT_EQ(report->faults.size(), 1u);
  EXPECT_NE(report->faults[0].find("program/000001.raw.zst: takes "), std::string::npos) << report->faults[0];
}

}  // namespace
}  // namespace lamina::pipeline
