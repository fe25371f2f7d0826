// Jobs whose saturation is a formula, and jobs of shares of voxels of several materials and doses.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/check/verify.h"
#include "pipeline/manifest/manifest.h"
#include "pipeline/run/run.h"
#include "stages/data/runs.h"
#include "stages/formats/images/image.h"
#include "stages/geometry/combine.h"
#include "tests/commands/job_folder.h"

namespace lamina::pipeline {
namespace {

class FormulaJobs : public test::JobFolder {
 protected:
  FormulaJobs() { test::write_box(folder_ / "box.stl", {0, 0, 0}, {8, 6, 0.4f}); }

  /// Two boxes of 8 x 6 x 0.4 mm on jet1000, the second one `gap` mm to the right of the first.
  Job job_of_boxes(const std::string& out, double gap = 5) const {
    Job job;
    job.machine.profile = "jet1000";
    job.layer_mm = 0.1;
    job.parts.push_back({.path = folder_ / "box.stl", .at_mm = std::array{10.0, 10.0}});
    job.parts.push_back({.path = folder_ / "box.stl", .at_mm = std::array{18.0 + gap, 10.0}});
    job.output = folder_ / out;
    return job;
  }
  Result<Summary> run_job(const Job& job) const {
    const std::atomic<bool> cancel{false};
    return run(
        job, Product::kImages, [](const ProgressEvent&) {}, cancel);
  }
  Json facts_of(const Job& job) const {
    const auto summary = run_job(job);
    EXPECT_TRUE(summary.ok()) << (summary.ok() ? "" : summary.error().message);
    const auto report = verify(job.output, {});
    EXPECT_TRUE(report.ok() && report->ok()) << (report.ok() && !report->faults.empty() ? report->faults[0] : "");
    return summary.ok() ? summary->facts : Json();
  }
  Runs image(const Job& job, const std::string& name) const {
    auto read = formats::image(job.output + "/layers/" + name);
    EXPECT_TRUE(read.ok()) << (read.ok() ? "" : read.error().message);
    return read.ok() ? std::move(read->runs) : Runs();
  }
  static bool alike(const Runs& a, const Runs& b) { return a.row_offset == b.row_offset && a.change == b.change; }
  static Runs both(const Runs& a, const Runs& b, SetOperation how) {
    Runs result;
    combine(a, b, how, result);
    return result;
  }
};

// The first box lies at x 10 to 18 mm of the bed: 20 + 5 x is 90 % there on average; the second one's own 60 - 4 x is 44 %.
TEST_F(FormulaJobs, CountFromTheBedOrFromThePart) {
  Job job = job_of_boxes("ramps");
  job.dose.saturation_percent = Saturation::of("20+5*x");
  job.parts[1].saturation_percent = Saturation::of("60-4*x");
  const auto facts = facts_of(job)["saturation"];
  EXPECT_NEAR(facts["requested_percent"].get<double>(), 67, 0.067);
  EXPECT_NEAR(facts["reached_percent"].get<double>(), facts["requested_percent"].get<double>(), 0.067);
  // Moved as a whole, the second one gets the same.
  Job moved = job_of_boxes("moved", 9);
  moved.parts.erase(moved.parts.begin());
  moved.dose.saturation_percent = 20;
  moved.parts[0].saturation_percent = Saturation::of("60-4*x");
  EXPECT_NEAR(facts_of(moved)["saturation"]["requested_percent"].get<double>(), 44, 0.05);
}

TEST_F(FormulaJobs, OfOneNumberAreThoseOfTheNumber) {
  Job number = job_of_boxes("number"), formula = job_of_boxes("formula");
  for (Job* job : {&number, &formula}) {
    job->dose.shell_mm = 1;
    job->dose.core_saturation_percent = 31;
    job->parts[1].bleed_um = {{60, 60}};
  }
  number.dose.saturation_percent = 62.5;
  formula.dose.saturation_percent = Saturation::of("62.5+0*x*y*z");
  const auto one = facts_of(number)["saturation"], other = facts_of(formula)["saturation"];
  EXPECT_EQ(one["drops"], other["drops"]);
  EXPECT_EQ(one["requested_percent"], other["requested_percent"]);
  EXPECT_EQ(one["max_drops"], other["max_drops"]);
  for (const char* layer : {"000000", "000003"}) {
    for (const char* drop : {"-drop1.tif", "-drop2.tif"})
      EXPECT_TRUE(alike(image(number, std::string(layer) + drop), image(formula, std::string(layer) + drop))) << layer << drop;
  }
}

TEST_F(FormulaJobs, AreTheSameHoweverTheyAreMade) {
  const std::string job = "jet " + test::corpus_file("dental_crown.stl") +
                          " --layer 1 --machine nuferbj --levels 16 --saturation 2+x/100+z/4 --core-saturation "
                          "1+cos(y)*exp(-z) --shell 0.6 --bleed 40 --mirror x";
  expect_same_however_made(job);
}

TEST_F(FormulaJobs, ThatGiveNoNumberOrDoNotBindAreRefused) {
  const std::string job = "jet box.stl --machine jet1000 --at 10,10 --layer 0.1 --quiet -o out --saturation ";
  test::expect_refused(job + "40+*x", 2, "variables are x, y and z", folder_);
  test::expect_refused(job + "40+q", 2, "variables are x, y and z", folder_);
  test::expect_refused(job + "-3", 2, "0 to 10000", folder_);
  test::expect_refused(job + "1,2", 2, "gives 2 numbers", folder_);
  test::expect_refused(job + "x-14", 2, "% in layer 0 at x 9.948", folder_);
  test::expect_refused(job + "60/(z-z)", 2, "is inf % in layer 0", folder_);
  const std::string shipped = test::read_text(LAMINA_TEST_DIR "/../pipeline/machine/shipped/printers/nuferbj.toml");
  test::write_text(folder_ / "binds.toml", shipped + "min_saturation_percent = 30\n");
  const std::string binds = "jet box.stl --machine binds.toml --at 40,40 --layer 0.1 --quiet -o out --saturation ";
  test::expect_refused(binds + "x-15", 2, "binds from 30 % on", folder_);
  done(binds + "x-9");
  done(binds + "x-15 --allow-unbound --overwrite");
}

// A column of voxels is half of one powder and half of the other: the later one has 8 of 15, the earlier one what is left.
TEST_F(FormulaJobs, SharesOfTwoMaterialsFillAVoxelOnce) {
  test::write_box(folder_ / "left.stl", {0, 0, 0}, {2.05f, 4, 0.3f});
  test::write_box(folder_ / "right.stl", {0, 0, 0}, {1.95f, 4, 0.3f});
  const std::string job = "jet --job two.toml --dpi 254 --bed 9x9 --quiet --levels 16 ";
  test::write_text(folder_ / "two.toml",
                   "[[part]]\npath = \"left.stl\"\nat_mm = [1, 1]\nmaterial = \"steel\"\n"
                   "[[part]]\npath = \"right.stl\"\nat_mm = [3.05, 1]\nmaterial = \"bronze\"\n");
  done(job + "--layer 0.1 -o two");
  done("verify two --quiet");
  const auto manifest = read_manifest(folder_ / "two/manifest.json");
  ASSERT_TRUE(manifest.ok()) << manifest.error().message;
  ASSERT_EQ(manifest->layers.size(), 3u);
  for (const LayerRecord& record : manifest->layers) {
    EXPECT_EQ(record.set_pixels, 1600u);  // 40 columns by 40 rows, none of them twice
    EXPECT_EQ(record.dosed_pixels, 1600u);
    ASSERT_EQ(record.images.size(), 2u);
    EXPECT_EQ(record.images[0].set_pixels + record.images[1].set_pixels, 1600u);
    EXPECT_NEAR(static_cast<double>(record.images[0].set_pixels), 800 + 40 * 7 / 15.0, 8);
  }
  done(job + "--layer 0.1 --threads 1 --mirror x -o mirrored");
  done("verify mirrored --quiet");
  test::expect_refused(job + "--layer 0.1 --format tiff-8 -o none", 2, "one material as grey", folder_);
}

// Parts that share no voxel get together what they get one by one, of shares of voxels too.
TEST_F(FormulaJobs, SharesOfPartsWithDosesAreThoseOfThePartsAlone) {
  test::write_box(folder_ / "odd.stl", {0, 0, 0}, {5.01f, 5.01f, 0.37f});
  Job job = job_of_boxes("doses");
  for (PartRequest& part : job.parts) part.path = folder_ / "odd.stl";
  job.parts[1].at_mm = {23.013, 10.007};
  job.levels = 16;
  job.dose.saturation_percent = 60;
  job.dose.shell_mm = 1;
  job.parts[1].saturation_percent = 90;
  job.parts[1].core_saturation_percent = 45;
  job.parts[1].bleed_um = {80, 80};
  const auto facts = facts_of(job);
  std::vector<Job> alone(2, job);
  std::uint64_t drops = 0;
  for (std::size_t i = 0; i < 2; ++i) {
    alone[i].output = folder_ / ("alone" + std::to_string(i));
    alone[i].parts = {job.parts[i]};
    drops += facts_of(alone[i])["saturation"]["drops"].get<std::uint64_t>();
  }
  EXPECT_EQ(facts["saturation"]["drops"].get<std::uint64_t>(), drops);
  for (const std::string layer : {"000000", "000003"}) {
    for (const std::string drop : {"-drop1.tif", "-drop2.tif"}) {
      const Runs merged = both(image(alone[0], layer + drop), image(alone[1], layer + drop), SetOperation::kUnion);
      EXPECT_TRUE(alike(image(job, layer + drop), merged)) << layer << drop;
    }
  }
}

// Two parts of different doses that touch within a voxel fill it once.
TEST_F(FormulaJobs, SharesOfPartsThatTouchComeToAFullVoxel) {
  Job job = job_of_boxes("touch", 0), one = job_of_boxes("one", 0);
  for (Job* of : {&job, &one}) {
    of->parts[0].at_mm = {10.013, 10};
    of->parts[1].at_mm = {18.013, 10};
    of->levels = 16;
    of->dose.saturation_percent = 40;
  }
  job.parts[1].saturation_percent = Saturation::of("40+0*x");
  EXPECT_EQ(facts_of(job)["saturation"]["drops"], facts_of(one)["saturation"]["drops"]);
  EXPECT_TRUE(alike(image(job, "000002-drop1.tif"), image(one, "000002-drop1.tif")));
}

// Even-odd over all parts: what is in two of them is empty, regardless of their doses.
TEST_F(FormulaJobs, EvenOddConsidersPartsOfAllDoses) {
  Job zones = job_of_boxes("zones", -3), plain = job_of_boxes("plain", -3);
  for (Job* of : {&zones, &plain}) of->fill_rule = FillRule::kEvenOdd;
  zones.parts[1].hole_bleed_um = {{1, 1}};  // moves nothing
  facts_of(zones);
  facts_of(plain);
  EXPECT_TRUE(alike(image(zones, "000001.tif"), image(plain, "000001.tif")));
  zones.levels = 4;
  zones.output = folder_ / "levels";
  const auto refused = run_job(zones);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("grey levels; choose nonzero"), std::string::npos) << refused.error().message;
}

}  // namespace
}  // namespace lamina::pipeline
