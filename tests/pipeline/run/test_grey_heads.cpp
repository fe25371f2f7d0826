// Jobs of heads that fire several drops of a pixel in one sweep: their files, programs and times.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "stages/data/levels.h"
#include "stages/formats/images/image.h"
#include "tests/commands/job_folder.h"

namespace lamina::pipeline {
namespace {

/// Pixels and layers of 100 um, of which half are voids: 500 pl, 5 drops of 100 pl. At 10 mm/s nozzles pass 100 places a
/// second, so that 350 Hz are 3 of the head's 7 drops. One swath of 64 lines is wider than the bed.
constexpr const char* kHead = R"([machine]
name = "seven"
dialect = "planes"
[bed]
size_mm = [5, 5]
[head]
nozzles = 64
pitch_um = 100
highest_frequency_hz = 350
drop_pl = 100
max_drops = 7
[motion]
scan_speed_mm_s = 10
travel_speed_mm_s = 200
ramp_mm = 5
[powder]
packing = 0.5
)";

class GreyHeads : public test::JobFolder {
 protected:
  GreyHeads() {
    test::write_text(folder_ / "seven.toml", kHead);
    test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 3, 0.2f});
    test::write_box(folder_ / "half.stl", {0, 0, 0}, {2, 3, 0.25f});
  }

  std::vector<LayerRecord> records_of(const std::string& output) const {
    const auto manifest = read_manifest(folder_ / (output + "/manifest.json"));
    EXPECT_TRUE(manifest.ok()) << manifest.error().message;
    return manifest.ok() ? manifest->layers : std::vector<LayerRecord>();
  }
};

constexpr const char* kBox = "jet box.stl --machine seven.toml --layer 0.1 --saturation 100 ";

// 5 drops are 3 and 2. The second sweep goes 19 steps of 0.1 mm and two ramps at 10 mm/s, and the head comes back at 200.
TEST_F(GreyHeads, FireWhatTheirFrequencyAllowsAndReportWhatThatAdds) {
  constexpr double kWay = 19 * 0.1 + 2 * 5;
  for (const char* how : {"--dry-run", "-o out"}) {
    const auto json = facts(kBox + std::string(how));
    const auto& jetting = json["jetting"];
    EXPECT_EQ(jetting["head_drops"], 7);
    EXPECT_EQ(jetting["sweep_drops"], 3);
    EXPECT_EQ(jetting["pixel_drops"], 5);
    EXPECT_EQ(jetting["sweeps_per_position"], 2);
    EXPECT_EQ(jetting["added_sweeps"], 2);
    EXPECT_NEAR(jetting["added_seconds"].get<double>(), 2 * (kWay / 10 + kWay / 200), 1e-5);
    EXPECT_EQ(json["saturation"]["max_jetted_drops"], 5);
  }
  const test::Outcome reported = lamina(kBox + std::string("--dry-run"));
  EXPECT_NE(reported.err.find(
                "2 over a position for up to 5 drops a pixel: 350 Hz allow 3 of the head's 7 drops at 10 mm/s, all of them "
                "at 5.0 mm/s; that adds 2 sweeps, 2.5 s"),
            std::string::npos)
      << reported.err;
  const auto records = records_of("out");
  ASSERT_EQ(records.size(), 2u);
  EXPECT_EQ(records[0].program.sweeps, 2u);
  EXPECT_EQ(records[0].program.added_sweeps, 1u);
  EXPECT_EQ(records[0].program.drops, 5u * 600);
  done("verify out --quiet");
  std::string text = test::read_text(folder_ / "out/manifest.json");
  test::write_text(folder_ / "kept.json", text);
  text.replace(text.find("\"added_sweeps\": 1"), 17, "\"added_sweeps\": 0");
  test::write_text(folder_ / "out/manifest.json", text);
  EXPECT_NE(lamina("verify out --quiet").err.find("1 sweeps are there for the head's frequency, the manifest says 0"),
            std::string::npos);
  test::write_text(folder_ / "out/manifest.json", test::read_text(folder_ / "kept.json"));
  // At half of the speed all of them fit, as the line says.
  const auto slow = facts(kBox + std::string("--scan-speed 5 -o slow"));
  EXPECT_EQ(slow["jetting"]["added_sweeps"], 0);
  EXPECT_EQ(slow["jetting"]["sweeps_per_position"], 1);
  EXPECT_EQ(records_of("slow")[0].program.sweeps, 1u);
  done("verify slow --quiet");
}

TEST_F(GreyHeads, DropsOfAPixelAreBoundBySweeps) {
  std::string text = kHead;
  text.insert(text.find("max_drops"), "max_drop_sweeps = 1\n");
  test::write_text(folder_ / "once.toml", text);
  const auto json = facts("jet box.stl --machine once.toml --layer 0.1 --saturation 100 --dry-run");
  EXPECT_EQ(json["jetting"]["pixel_drops"], 3);
  EXPECT_NEAR(json["saturation"]["reached_percent"].get<double>(), 60, 1e-6);
  test::expect_refused("jet box.stl --machine once.toml --layer 0.1 --levels 16 --no-dither -o none", 2,
                       "15 drops of a full voxel, 3 can be jetted", folder_);
}

// A pixel's drops of 15 are its level: 5 of 15.
TEST_F(GreyHeads, WriteDropsAsOneGreyImage) {
  done(kBox + std::string("-o bits"));
  for (const char* format : {"tiff-4", "tiff-8", "png-8"}) {
    const std::string job = kBox + ("--format " + std::string(format)) + " -o ";
    done(job + format);
    done(std::string("verify --quiet ") + format);
    const bool png = format == std::string("png-8");
    const std::string file = folder_ / (std::string(format) + "/layers/000001" + (png ? ".png" : ".tif"));
    Levels levels;
    const auto image = formats::levels(file, 15, levels);
    ASSERT_TRUE(image.ok()) << image.error().message;
    EXPECT_EQ(levels.level.size(), 30u);
    for (const std::uint8_t level : levels.level) EXPECT_EQ(level, 5);
    EXPECT_EQ(test::read_text(folder_ / (std::string(format) + "/program/000001.planes.zst")),
              test::read_text(folder_ / "bits/program/000001.planes.zst"));
    const auto records = records_of(format);
    EXPECT_EQ(records[1].set_pixels, 600u);
    EXPECT_EQ(records[1].drops, 3000u);
    EXPECT_EQ(records[1].max_drops, 5u);
    done(job + "other --threads 1 --engine contours");
    EXPECT_TRUE(tree("other") == tree(format));
    std::filesystem::remove_all(folder_.path() / "other");
    for (const char* shard : {"1/2", "2/2"}) done(job + "shards --shard " + shard);
    done("merge shards -o shards --quiet");
    EXPECT_TRUE(tree("shards") == tree(format));
    std::filesystem::remove_all(folder_.path() / "shards");
    std::filesystem::copy_file(file, folder_.path() / "kept", std::filesystem::copy_options::overwrite_existing);
    test::write_text(file, "another");
    EXPECT_EQ(lamina(std::string("verify --quiet ") + format).code, 5);
    const auto resumed = facts(job + format + " --resume");
    EXPECT_EQ(resumed["jetting"]["added_sweeps"], 2);
    EXPECT_EQ(resumed["saturation"]["max_jetted_drops"], 5);
    EXPECT_EQ(test::read_text(file), test::read_text(folder_ / "kept"));
    test::expect_refused(std::string("jet ") + format + " --dpi 254 --bed 5x5 -o none", 3, "drops of a pixel as grey", folder_);
  }
  test::expect_refused("jet box.stl --machine seven.toml --layer 0.1 --saturation 500 --format tiff-4 -o none", 2,
                       "stores up to 15 drops per pixel, the job has 25; choose tiff-8", folder_);
  done("jet box.stl --machine seven.toml --layer 0.1 --saturation 500 --format tiff-8 -o many --quiet");
  done("verify many --quiet");
  EXPECT_EQ(records_of("many")[0].max_drops, 25u);
  done("jet box.stl --machine nuferbj --layer 0.1 --saturation 5 --format png-8 -o one --quiet");
  done("verify one --quiet");
}

// Half of a voxel is level 2 of 3, and 8 of 15.
TEST_F(GreyHeads, TakeLevelsAsDrops) {
  const std::string job = "jet half.stl --machine seven.toml --layer 0.1 --no-dither ";
  for (const auto& [levels, half] : {std::pair{4u, 2u}, {16u, 8u}}) {
    const std::string output = "of" + std::to_string(levels);
    const auto json = facts(job + "--levels " + std::to_string(levels) + " -o " + output);
    EXPECT_EQ(json["jetting"]["pixel_drops"], levels - 1);
    EXPECT_EQ(json["jetting"]["sweeps_per_position"], (levels - 1 + 2) / 3);
    const auto records = records_of(output);
    ASSERT_EQ(records.size(), 3u);
    EXPECT_EQ(records[0].drops, 600u * (levels - 1));
    EXPECT_EQ(records[2].drops, 600u * half);
    EXPECT_EQ(records[2].program.drops, 600u * half);
    done("verify " + output + " --quiet");
  }
}

// A hundredth of a thousandth more than 5 drops: planned are 6, and a pixel gets 5.
TEST_F(GreyHeads, ReportTheMaxDropsThatAreJetted) {
  test::write_box(folder_ / "dot.stl", {0, 0, 0}, {0.1f, 0.1f, 0.1f});
  const auto json = facts("jet dot.stl --machine seven.toml --layer 0.1 --saturation 100.001 --dry-run");
  EXPECT_EQ(json["saturation"]["max_drops"], 6);
  EXPECT_EQ(json["saturation"]["max_jetted_drops"], 5);
}

TEST_F(GreyHeads, AreTheShippedOneToo) {
  const test::Outcome checked = lamina("machines --check jet1000-grey");
  EXPECT_NE(checked.out.find("all 3 of a pixel in one sweep at that speed, as 2 bits"), std::string::npos) << checked.out;
  done("jet box.stl --machine jet1000-grey --layer 0.1 --saturation 60 -o out --quiet");
  done("verify out --quiet");
}

// The statements of jet about all layers are repeated by merge and report from the manifests.
TEST_F(GreyHeads, ReportTheSweepsThatAreAddedAfterAMergeToo) {
  const test::Outcome whole = lamina(kBox + std::string("-o whole"));
  ASSERT_EQ(whole.code, 0) << whole.err;
  const std::size_t from = whole.err.find("; that adds ");
  ASSERT_NE(from, std::string::npos) << whole.err;
  const std::string added = whole.err.substr(from, whole.err.find('\n', from) - from);
  for (const char* shard : {"1/2", "2/2"}) done(kBox + std::string("--quiet -o parts --shard ") + shard);
  const test::Outcome merged = lamina("merge parts -o parts");
  EXPECT_EQ(merged.code, 0) << merged.err;
  EXPECT_NE(merged.err.find(added), std::string::npos) << merged.err;
  done("report parts -o page.html --quiet");
  std::ifstream page(folder_ / "page.html");
  const std::string text{std::istreambuf_iterator<char>(page), {}};
  EXPECT_NE(text.find(added), std::string::npos);
}

}  // namespace
}  // namespace lamina::pipeline
