// Jobs whose parts, holes and first layers get bleeds and saturations of their own.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/check/verify.h"
#include "pipeline/run/run.h"
#include "stages/data/machine.h"
#include "stages/data/runs.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/combine.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

Result<Summary> run_part_doses(const Job& job) {
  const std::atomic<bool> cancel{false};
  return run(
      job, Product::kImages, [](const ProgressEvent&) {}, cancel);
}

/// Two boxes of 8 x 6 x 0.4 mm side by side on jet1000, 5 mm apart or touching.
Job job_of_boxes(const test::Directory& folder, const std::string& out, double gap_mm = 5) {
  test::write_box(folder / "box.stl", {0, 0, 0}, {8, 6, 0.4f});
  Job job;
  job.machine.profile = "jet1000";
  job.layer_mm = 0.1;
  job.parts.push_back({.path = folder / "box.stl", .at_mm = std::array{10.0, 10.0}});
  job.parts.push_back({.path = folder / "box.stl", .at_mm = std::array{18.0 + gap_mm, 10.0}});
  job.output = folder / out;
  job.image_content = ImageContent::kDrops;
  return job;
}

Runs layer_of(const Job& job, const std::string& name) {
  auto read = formats::image(job.output + "/layers/" + name);
  EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().message);
  return read.ok() ? std::move(read->runs) : Runs();
}

bool same(const Runs& a, const Runs& b) { return a.row_offset == b.row_offset && a.change == b.change; }

Runs merged(const Runs& a, const Runs& b) {
  Runs both;
  combine(a, b, SetOperation::kUnion, both);
  return both;
}

void expect_replayed(const Job& job) {
  const auto report = verify(job.output, {});
  ASSERT_TRUE(report.ok()) << report.error().message;
  EXPECT_TRUE(report->ok()) << (report->faults.empty() ? "" : report->faults[0]);
  EXPECT_EQ(report->replayed, report->layers);
}

// A pixel's drops depend on its place, its layer and its dose alone: parts together get what they get one by one.
TEST(PartDoses, AreThoseOfJobsWithThePartAlone) {
  const test::Directory folder;
  Job both = job_of_boxes(folder, "both");
  both.dose.saturation_percent = 60;
  both.dose.shell_mm = 1;
  both.dose.bleed_um = {40, 40};
  both.parts[1].saturation_percent = 90;
  both.parts[1].core_saturation_percent = 45;
  both.parts[1].bleed_um = {-80, -80};
  ASSERT_TRUE(run_part_doses(both).ok());
  expect_replayed(both);
  std::vector<Job> alone(2, both);
  for (std::size_t i = 0; i < 2; ++i) {
    alone[i].output = folder / ("alone" + std::to_string(i));
    alone[i].parts = {both.parts[i]};
  }
  alone[1].dose = {};  // the same dose, stated for the job
  alone[1].dose.saturation_percent = 90;
  alone[1].dose.core_saturation_percent = 45;
  alone[1].dose.shell_mm = 1;
  alone[1].dose.bleed_um = {-80, -80};
  alone[1].parts[0].saturation_percent.reset();
  alone[1].parts[0].core_saturation_percent.reset();
  alone[1].parts[0].bleed_um.reset();
  for (const Job& job : alone) ASSERT_TRUE(run_part_doses(job).ok());
  for (const std::string layer : {"000000", "000003"}) {
    for (const std::string drop : {"-drop1.tif", "-drop2.tif", "-drop3.tif"}) {
      const Runs first = layer_of(alone[0], layer + drop), second = layer_of(alone[1], layer + drop);
      EXPECT_TRUE(same(layer_of(both, layer + drop), merged(first, second))) << layer << drop;
    }
  }
}

// What touches another part has no edge there, regardless of its bleed.
TEST(PartDoses, NoSeamIsEatenBetweenPartsThatTouch) {
  const test::Directory folder;
  Job job = job_of_boxes(folder, "touching", 0);
  job.dose.bleed_um = {100, 100};
  job.parts[1].bleed_um = {200, 200};
  const auto summary = run_part_doses(job);
  ASSERT_TRUE(summary.ok()) << summary.error().message;
  const Runs image = layer_of(job, "000001.tif");
  for (std::uint32_t r = 0; r < image.view().rows(); ++r) EXPECT_LE(image.view().row(r).size(), 2u) << "row " << r;
  expect_replayed(job);
}

TEST(PartDoses, GrowingAndErodingMoveAnEdgeByTheSameLength) {
  const test::Directory folder;
  std::vector<double> widths;
  for (const double um : {-200.0, 0.0, 200.0}) {
    Job job = job_of_boxes(folder, "moved" + std::to_string(static_cast<int>(um)));
    job.dose.bleed_um = {um, um};
    ASSERT_TRUE(run_part_doses(job).ok());
    const Runs image = layer_of(job, "000002.tif");
    const std::uint32_t middle = image.view().rows() - static_cast<std::uint32_t>(13 / 25.4 * 720);
    ASSERT_EQ(image.view().row(middle).size(), 4u);
    widths.push_back((image.view().row(middle)[1] - image.view().row(middle)[0]) * 25.4 / 720);
  }
  // Whole pixels of 35.3 um: 5 of them are within 200 um of an edge.
  EXPECT_NEAR(widths[0] - widths[1], 2 * 5 * 25.4 / 720, 1e-9);
  EXPECT_NEAR(widths[1] - widths[2], 2 * 5 * 25.4 / 720, 1e-9);
}

TEST(PartDoses, HolesAndFirstLayersHaveABleedOfTheirOwn) {
  const test::Directory folder;
  // A frame: four boxes around a hole of 4 x 4 mm.
  Job job = job_of_boxes(folder, "frame");
  job.parts.clear();
  test::write_box(folder / "long.stl", {0, 0, 0}, {8, 2, 0.4f});
  test::write_box(folder / "side.stl", {0, 0, 0}, {2, 4, 0.4f});
  for (const std::array<double, 2> at : {std::array{10.0, 10.0}, {10.0, 16.0}})
    job.parts.push_back({.path = folder / "long.stl", .at_mm = at});
  for (const std::array<double, 2> at : {std::array{10.0, 12.0}, {16.0, 12.0}})
    job.parts.push_back({.path = folder / "side.stl", .at_mm = at});
  job.dose.bleed_um = {100, 100};
  job.dose.hole_bleed_um = {-200, -200};
  job.dose.first_bleed_um = {0, 0};
  job.dose.first_layers = 2;
  ASSERT_TRUE(run_part_doses(job).ok());
  const auto middle_row = [&](const char* name) {
    const Runs image = layer_of(job, name);
    const std::uint32_t middle = image.view().rows() - static_cast<std::uint32_t>(14 / 25.4 * 720);
    const auto row = image.view().row(middle);
    return std::vector<std::uint32_t>(row.begin(), row.end());
  };
  const std::vector<std::uint32_t> first = middle_row("000001.tif"), later = middle_row("000002.tif");
  ASSERT_EQ(first.size(), 4u);
  ASSERT_EQ(later.size(), 4u);
  EXPECT_EQ(later[0], first[0] + 2);  // 100 um: two pixels
  EXPECT_EQ(later[3], first[3] - 2);
  EXPECT_EQ(later[1], first[1] + 5);  // 200 um: five
  EXPECT_EQ(later[2], first[2] - 5);
}

// A changed number of drops is found even where every file is as written.
TEST(PartDoses, RecordedDropsAreComparedWithTheImages) {
  const test::Directory folder;
  Job job = job_of_boxes(folder, "drops");
  job.dose.saturation_percent = 60;
  ASSERT_TRUE(run_part_doses(job).ok());
  const std::string path = job.output + "/manifest.json";
  std::string manifest = test::read_text(path);
  const std::size_t drops = manifest.rfind("\"requested_drops\"");
  const std::size_t at = manifest.rfind("\"drops\":", drops);
  ASSERT_NE(at, std::string::npos);
  const std::size_t digit = manifest.find_first_of("0123456789", at);
  manifest[digit] = manifest[digit] == '9' ? '8' : static_cast<char>(manifest[digit] + 1);
  test::write_text(path, manifest);
  const auto report = verify(job.output, {});
  ASSERT_TRUE(report.ok()) << report.error().message;
  ASSERT_FALSE(report->ok());
  EXPECT_NE(report->faults[0].find("drops, the manifest says"), std::string::npos) << report->faults[0];
}

// Rounding to whole drops is the same for one dose and for several.
TEST(PartDoses, RoundedDropsAreThoseOfOneDose) {
  const test::Directory folder;
  std::vector<std::uint64_t> drops;
  for (const bool zones : {false, true}) {
    Job job = job_of_boxes(folder, zones ? "zones" : "one");
    job.dose.saturation_percent = 70;
    job.dose.dithered = false;
    if (zones) job.parts[1].hole_bleed_um = {1, 1};  // moves nothing
    const auto summary = run_part_doses(job);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    drops.push_back(summary->facts["saturation"]["drops"].get<std::uint64_t>());
  }
  EXPECT_EQ(drops[0], drops[1]);
}

// A bleed leaves the voxels alone that lie at no edge that it moves.
TEST(PartDoses, SharesOfVoxelsStayWhereNoEdgeMoves) {
  const test::Directory folder;
  std::vector<std::uint64_t> full;
  for (const double um : {0.0, 10.0, 100.0}) {  // a pixel is 35.3 um
    Job job = job_of_boxes(folder, "shares" + std::to_string(static_cast<int>(um)));
    test::write_box(folder / "odd.stl", {0, 0, 0}, {5.01f, 5.01f, 0.4f});
    job.parts = {{.path = folder / "odd.stl", .at_mm = std::array{10.01, 10.01}}};
    job.levels = 16;
    job.dose.bleed_um = {um, um};
    const auto summary = run_part_doses(job);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    full.push_back(summary->facts["voxels"]["full_voxels"].get<std::uint64_t>());
  }
  EXPECT_EQ(full[0], full[1]);
  EXPECT_LT(full[2], full[1]);
}

// Whose drops are whose adds up where voxels at the edges of parts are only partly full.
TEST(PartDoses, SharesOfVoxelsAreSharedOutAmongPartsAndVerified) {
  const test::Directory folder;
  for (const std::uint32_t levels : {2u, 4u, 16u}) {
    Job job = job_of_boxes(folder, "quoted" + std::to_string(levels));
    test::write_box(folder / "odd.stl", {0, 0, 0}, {5.013f, 3.017f, 0.37f});
    job.parts[1].path = folder / "odd.stl";
    job.parts[1].at_mm = {20.013, 10.007};
    job.levels = levels;
    job.quote = true;
    const auto summary = run_part_doses(job);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    expect_replayed(job);
    const auto& use = summary->facts["use"];
    std::uint64_t drops = 0;
    for (const auto& part : use["parts"]) drops += part["drops"].get<std::uint64_t>();
    EXPECT_EQ(drops, use["drops"].get<std::uint64_t>());
  }
}

TEST(PartDoses, WhatCannotBeIsRefusedInOneLine) {
  const test::Directory folder;
  const auto refused = [&](const auto& change, const std::string& words) {
    Job job = job_of_boxes(folder, "refused");
    change(job);
    const Status status = check_job(job);
    const auto summary = status.ok() ? run_part_doses(job) : Result<Summary>(status.error());
    ASSERT_FALSE(summary.ok()) << words;
    EXPECT_EQ(summary.error().fault, Fault::kUsage);
    EXPECT_NE(summary.error().message.find(words), std::string::npos) << summary.error().message;
    EXPECT_EQ(summary.error().message.find('\n'), std::string::npos);
  };
  refused([](Job& job) { job.dose.bleed_um = {40, -40}; }, "two numbers of one sign");
  refused([](Job& job) { job.parts[1].saturation_percent = 50; }, "add --saturation");
  refused([](Job& job) { job.dose.bleed_um = {-600, -600}, job.parts[0].at_mm = {0.5, 10}; }, "grow 0.100 mm beyond the bed");
  refused(
      [](Job& job) {
        job.machine.profile = "nuferbj";
        job.parts[0].at_mm = {40, 40}, job.parts[1].at_mm = {52, 40};
        job.parts[0].material = "steel", job.parts[1].material = "bronze";
        job.machine.vat_rule = VatRule::kMajority;
        job.dose.bleed_um = {-40, -40};
      },
      "no material");
}

}  // namespace
}  // namespace lamina::pipeline
