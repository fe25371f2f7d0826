// What a manifest says of pixels to be filled and of requested drops is worked out again by lamina verify: jobs as they are
// written hold, and numbers that were changed are found.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "pipeline/check/verify.h"
#include "pipeline/job/job.h"
#include "pipeline/run/run.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

class DosesOnRecord : public ::testing::Test {
 protected:
  /// A prism of 20 x 10 x 0.4 mm for nuferbj: 206 x 103 pixels of 97 um, voids of 376 pl in a layer of 0.1 mm, drops of 50 pl.
  Job prism(const std::string& out) const {
    const fs::path path = directory_.path() / (out + ".stl");
    test::write_box(path, {0, 0, 0}, {20, 10, 0.4F});
    Job job;
    job.parts.emplace_back();
    job.parts[0].path = path.string();
    job.parts[0].at_mm = {39, 44};
    job.machine.profile = "nuferbj";
    job.layer_mm = 0.1;
    job.output = directory_ / out;
    job.image_content = ImageContent::kDrops;
    return job;
  }
  static void make(const Job& job) {
    const std::atomic<bool> cancel{false};
    const auto summary = run(
        job, Product::kImages, [](const ProgressEvent&) {}, cancel);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
  }
  static std::string faults(const Job& job) {
    const auto report = verify(job.output, {});
    if (!report) return report.error().message;
    std::string all;
    for (const std::string& fault : report->faults) all += fault + "\n";
    return all;
  }
  static std::string manifest(const Job& job) { return test::read_text(fs::path(job.output) / "manifest.json"); }
  static std::uint64_t number(const Job& job, const std::string& key) {
    std::smatch found;
    const std::string text = manifest(job);
    EXPECT_TRUE(std::regex_search(text, found, std::regex("\"" + key + "\": ?([0-9]+)"))) << key;
    return std::stoull(found[1]);
  }
  /// What is found with the first layer's number changed; the manifest is as it was afterwards.
  static std::string with(const Job& job, const std::vector<std::pair<std::string, std::uint64_t>>& changes) {
    const std::string good = manifest(job);
    std::string text = good;
    for (const auto& [key, value] : changes) {
      text = std::regex_replace(text, std::regex("(\"" + key + "\": ?)[0-9]+"), fmt::format("$01{}", value),
                                std::regex_constants::format_first_only);
    }
    EXPECT_NE(text, good);
    test::write_text(fs::path(job.output) / "manifest.json", text);
    const std::string found = faults(job);
    test::write_text(fs::path(job.output) / "manifest.json", good);
    return found;
  }
  static void expect_found(const std::string& found, const std::string& what) {
    EXPECT_NE(found.find(what), std::string::npos) << (found.empty() ? "nothing is found, where " + what : found);
  }

  test::Directory directory_;
};

// 70 % of 376 pl are 5.27 drops a pixel: both numbers follow from the image, to the drop.
TEST_F(DosesOnRecord, WhereEachPixelGetsADropBothNumbersAreExact) {
  Job job = prism("whole");
  job.dose.saturation_percent = 70;
  make(job);
  EXPECT_EQ(faults(job), "");
  const std::uint64_t dosed = number(job, "dosed_pixels"), requested = number(job, "requested_drops");
  for (const std::uint64_t other : {dosed - 1, dosed + 1, 2 * dosed}) {
    expect_found(with(job, {{"dosed_pixels", other}}), fmt::format("the manifest says dosed_pixels {}", other));
  }
  for (const std::uint64_t other : {requested - 1, requested + 1, std::uint64_t{0}, 2 * requested}) {
    expect_found(with(job, {{"requested_drops", other}}), fmt::format("the manifest says requested_drops {}", other));
  }
}

// 5 % are 0.38 drops a pixel: the images do not show which pixels have none.
TEST_F(DosesOnRecord, WhereFewerFallTheyAreBounded) {
  Job job = prism("sparse");
  job.dose.saturation_percent = 5;
  make(job);
  EXPECT_EQ(faults(job), "");
  const std::uint64_t dosed = number(job, "dosed_pixels"), requested = number(job, "requested_drops");
  expect_found(with(job, {{"requested_drops", requested + 2}}), "the manifest says requested_drops");
  expect_found(with(job, {{"dosed_pixels", dosed + 5}}), "the manifest says requested_drops");
  expect_found(with(job, {{"dosed_pixels", dosed / 4}, {"requested_drops", requested / 4}}),
               "is the minimum that its images can have");
  expect_found(with(job, {{"dosed_pixels", 2 * dosed}, {"requested_drops", 2 * requested}}),
               "is the maximum that its parts can have");
}

TEST_F(DosesOnRecord, ShellsAndCoresLieBetweenTheirTargets) {
  Job job = prism("core");
  job.dose.saturation_percent = 70;
  job.dose.core_saturation_percent = 20;
  job.dose.shell_mm = 1;
  make(job);
  EXPECT_EQ(faults(job), "");
  const std::uint64_t dosed = number(job, "dosed_pixels");
  expect_found(with(job, {{"requested_drops", 6 * dosed}}), "with a target of 1.5");
  expect_found(with(job, {{"requested_drops", dosed}}), "to 5.2");
  expect_found(with(job, {{"dosed_pixels", dosed + 1}}), "each pixel gets a drop");
}

// Ranges of heights, a part with its own target, whole drops, grown and mirrored images: what is written is valid.
TEST_F(DosesOnRecord, OrdinaryJobsHold) {
  Job job = prism("ranges");
  job.dose.saturation_percent = 70;
  job.dose.saturation_ranges = {{0.1, 0.2, 30, {}}, {0.3, 0.5, 90, 20}};
  job.dose.shell_mm = 1;
  job.dose.dithered = false;
  job.mirror = Mirror::kX;
  job.dose.bleed_um = {-150, -150};
  make(job);
  EXPECT_EQ(faults(job), "");

  Job own = prism("own");
  own.parts.push_back(own.parts[0]);
  own.parts[1].at_mm = {39, 60};
  own.parts[1].saturation_percent = 30;
  own.dose.saturation_percent = 70;
  make(own);
  EXPECT_EQ(faults(own), "");
  const std::uint64_t dosed = number(own, "dosed_pixels");
  expect_found(with(own, {{"requested_drops", 2 * dosed}}), "the manifest says requested_drops");

  for (const std::uint32_t levels : {2u, 4u, 16u}) {
    Job drops = prism(fmt::format("drops{}", levels));
    drops.levels = levels;
    make(drops);
    EXPECT_EQ(faults(drops), "") << levels;
    drops.dose.saturation_percent = 120;
    drops.output += "s";
    make(drops);
    EXPECT_EQ(faults(drops), "") << levels;
    expect_found(with(drops, {{"requested_drops", number(drops, "requested_drops") * 11 / 10}}),
                 "the manifest says requested_drops");
  }
}

TEST_F(DosesOnRecord, LevelsSumUpToTheirFullVoxels) {
  for (const std::uint32_t levels : {2u, 4u, 16u}) {
    Job job = prism(fmt::format("grey{}", levels));
    job.machine.profile.clear();
    job.dpi = {{300, 300}};
    job.levels = levels;
    job.format = "tiff-8";
    make(job);
    EXPECT_EQ(faults(job), "");
    const std::uint64_t dosed = number(job, "dosed_pixels");
    expect_found(with(job, {{"dosed_pixels", dosed + 1}}), fmt::format("its levels come to {} full voxels", dosed));
    const std::uint64_t differs = number(job, "half_differs");
    expect_found(with(job, {{"half_far", differs + 1}}), "pixels whose voxels differ");
  }
}

}  // namespace
}  // namespace lamina::pipeline
