// Shares of voxels through the plan of a job, and as drops to its files.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/run/layer_imager.h"
#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "tests/commands/job_folder.h"

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
  coverage::CoverageScratch scratch;
  Levels image;
  double volume = 0;
  for (std::uint32_t i = 0; i < plan->layer_count; ++i) {
    const coverage::CoverageReport report = imager.levels(plan->layer(i), scratch, image);
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

/// A box whose top lies in the middle of its third layer, and what else a test needs.
class LevelJobs : public test::JobFolder {
 protected:
  LevelJobs() { test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 3, 0.25f}); }

  std::vector<LayerRecord> records_of(const std::string& output) const {
    const auto manifest = read_manifest(folder_ / (output + "/manifest.json"));
    EXPECT_TRUE(manifest.ok()) << manifest.error().message;
    return manifest.ok() ? manifest->layers : std::vector<LayerRecord>();
  }
};

constexpr const char* kTenthsOfBox = "jet box.stl --layer 0.1 --dpi 254 --bed 5x5 --at 1,1 --quiet ";

// Half of a voxel is level 8 of 15, 2 of 3 and 1 of 1: of 600 voxels 320, 400 and 600.
TEST_F(LevelJobs, GiveEachVoxelDropsByItsShare) {
  for (const auto& [levels, full] : {std::pair{16, 320u}, {4, 400u}, {2, 600u}}) {
    const std::string output = "of" + std::to_string(levels);
    done(kTenthsOfBox + ("--levels " + std::to_string(levels)) + " -o " + output);
    const auto records = records_of(output);
    ASSERT_EQ(records.size(), 3u);
    EXPECT_EQ(records[0].set_pixels, 600u);
    EXPECT_EQ(records[2].dosed_pixels, full);
    EXPECT_EQ(records[2].requested_drops, full);
    EXPECT_EQ(records[2].drops, records[2].set_pixels);
    EXPECT_NEAR(static_cast<double>(records[2].drops), full, 12);
    done("verify " + output + " --quiet");
  }
  done(kTenthsOfBox + std::string("--levels 16 --no-dither -o rounded"));
  EXPECT_EQ(records_of("rounded")[2].set_pixels, 600u);
  // The top lies on the plane, where a pixel is not set and a tie of shares goes up: no boundary is near.
  EXPECT_EQ(records_of("rounded")[2].half_differs, 600u);
  EXPECT_EQ(records_of("rounded")[2].half_far, 600u);
  done(kTenthsOfBox + std::string("-o plain"));
  EXPECT_EQ(records_of("plain")[1].hash, records_of("rounded")[1].hash);
}

TEST_F(LevelJobs, ReportHowFarHalvesAreFromTheBitmap) {
  const test::Outcome outcome = lamina("jet " + test::corpus_file("dental_crown.stl") +
                                       " --layer 0.3 --dpi 300 --bed 20x20 --levels 2 --no-dither --json --quiet -o crown");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto voxels = nlohmann::json::parse(outcome.out)["voxels"];
  EXPECT_EQ(voxels["half_far"], 0);
  EXPECT_GT(voxels["half_differs"], 0);
  EXPECT_LT(voxels["half_differs_share"], 0.01);
  std::uint64_t differs = 0;
  for (const LayerRecord& record : records_of("crown")) differs += record.half_differs;
  EXPECT_EQ(voxels["half_differs"], differs);
}

TEST_F(LevelJobs, GiveTheSameBytesHoweverTheyAreMade) {
  const std::string job = "jet " + test::corpus_file("dental_crown.stl") +
                          " --layer 1 --machine nuferbj --levels 16 --saturation 3 --core-saturation 1 --shell 0.6 "
                          "--bleed 40 --mirror x";
  expect_same_however_made(job);
}

// The box mirrored: its columns 10 to 29 of 50 are 20 to 39; half of a voxel is level 8.
TEST_F(LevelJobs, WriteLevelsAsGreyInFormatsThatCarryThem) {
  for (const char* format : {"tiff-4", "tiff-8", "png-8"}) {
    const std::string job = std::string(kTenthsOfBox) + "--levels 16 --mirror x --format " + format + " -o ";
    done(job + format);
    done(std::string("verify --quiet ") + format);
    const auto records = records_of(format);
    ASSERT_EQ(records.size(), 3u);
    EXPECT_EQ(records[2].set_pixels, 600u);
    EXPECT_EQ(records[2].dosed_pixels, 320u);
    Levels levels;
    const std::string top =
        folder_ / (std::string(format) + "/layers/000002" + (format == std::string("png-8") ? ".png" : ".tif"));
    const auto image = formats::levels(top, 15, levels);
    ASSERT_TRUE(image.ok()) << image.error().message;
    ASSERT_EQ(levels.level.size(), 30u);
    EXPECT_EQ(levels.change[0], 20u);
    EXPECT_EQ(levels.change[1], 40u);
    EXPECT_EQ(levels.level[0], 8);
    for (const char* shard : {"1/2", "2/2"}) done(job + "shards --threads 1 --shard " + shard);
    done("merge shards -o shards --quiet");
    EXPECT_TRUE(tree("shards") == tree(format));
    std::filesystem::remove_all(folder_.path() / "shards");
    test::write_text(top, "another");
    EXPECT_EQ(lamina(std::string("verify --quiet ") + format).code, 5);
    done(job + format + " --resume");
    done(std::string("verify --quiet ") + format);
    test::expect_refused(kTenthsOfBox + std::string("-o none --format ") + format, 2, "add --levels 2, 4 or 16", folder_);
    test::expect_refused("jet box.stl --machine nuferbj -o none --format " + std::string(format), 2,
                         "--machine and --saturation", folder_);
  }
  done("jet tiff-8 --dpi 254 --bed 5x5 --quiet -o half");
  EXPECT_EQ(records_of("half")[2].set_pixels, 600u);
}

TEST_F(LevelJobs, OfWhatHasNoSharesAreRefused) {
  const std::string job = kTenthsOfBox + std::string("--levels 4 -o out ");
  test::expect_refused(job + "--fill raster", 2, "leave out walls, fillings", folder_);
  test::expect_refused(job + "--core 0.5", 2, "--core-saturation", folder_);
  test::expect_refused(job + "--heights cusp --thickness 0.05,0.1 --containment inside", 2, "--containment", folder_);
  test::expect_refused(kTenthsOfBox + std::string("--levels 3 -o out"), 2, "use one of off, 2, 4, 16", folder_);
  test::expect_refused(kTenthsOfBox + std::string("--no-dither -o out"), 2, "add --levels or --saturation", folder_);
}

}  // namespace
}  // namespace lamina::pipeline
