// What jobs store: compressed print programs, images of the geometry, and no more than their file system can take.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/manifest/manifest.h"
#include "pipeline/run/space.h"
#include "stages/support/io/compressed.h"
#include "tests/commands/program.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPlanesPrinter = R"([machine]
name = "printer"
dialect = "planes"
[bed]
size_mm = [20, 12]
build_height_mm = 50
[head]
nozzles = 120
pitch_um = 100
drop_pl = 85
[powder]
packing = 0.6
)";

class StoredJobs : public testing::Test {
 protected:
  StoredJobs() {
    test::write_text(folder_ / "planes.toml", kPlanesPrinter);
    std::string raw = kPlanesPrinter;
    raw.replace(raw.find("planes"), 6, "raw");
    test::write_text(folder_ / "raw.toml", raw);
    test::write_box(folder_ / "box.stl", {0, 0, 0}, {9.03f, 8.06f, 1.03f});
  }
  test::Outcome lamina(const std::string& line) const { return test::run_lamina(test::words_of(line), folder_.path()); }
  std::string done(const std::string& line) const {
    const test::Outcome outcome = lamina(line);
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    return outcome.out;
  }
  void jet(const std::string& machine, const std::string& words) const {
    done("jet box.stl --machine " + machine + ".toml --layer 0.1 --quiet " + words);
  }
  static std::string content_of(const std::string& file) {
    const auto content = read_content(file, 1 << 26);
    EXPECT_TRUE(content.ok()) << (content ? "" : content.error().message);
    return content ? *content : std::string();
  }
  std::string program_text(const std::string& job) const {
    std::string text;
    for (const std::string& name : test::files_below(folder_ / (job + "/program"))) {
      if (!name.ends_with(".toml")) text += content_of(folder_ / (job + "/program/" + name));
    }
    return text;
  }
  /// The one error line of a command that fails with this code.
  std::string refused(int code, const std::string& line) const {
    const test::Outcome outcome = lamina(line);
    EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    return outcome.err;
  }
  test::Directory folder_;
};

TEST_F(StoredJobs, CompressedProgramsAreThePlainOnes) {
  for (const std::string machine : {"planes", "raw"}) {
    jet(machine, "-o small");
    jet(machine, "--set program.compress=false -o plain");
    const std::string small = folder_ / ("small/program/000003." + machine + ".zst");
    const std::string plain = folder_ / ("plain/program/000003." + machine);
    ASSERT_TRUE(fs::exists(small) && fs::exists(plain));
    EXPECT_LT(4 * fs::file_size(small), fs::file_size(plain));
    EXPECT_TRUE(content_of(small) == test::read_text(plain));
    std::string whole = test::read_text(folder_ / ("plain/program/start." + machine));
    for (const std::string& name : test::files_below(folder_ / "plain/program")) {
      if (name.starts_with("0")) whole += test::read_text(folder_ / ("plain/program/" + name));
    }
    whole += test::read_text(folder_ / ("plain/program/end." + machine));
    for (const std::string job : {"small", "plain"}) {
      EXPECT_TRUE(done("stream " + job + " --quiet") == whole) << job;
      done("stream " + job + " --quiet --overwrite -o whole");
      EXPECT_TRUE(test::read_text(folder_ / "whole") == whole) << job;
      done("verify " + job + " --quiet");
      done("report " + job + " --quiet --overwrite -o page.html");
    }
    const auto records = read_manifest(folder_ / "small/manifest.json"),
               others = read_manifest(folder_ / "plain/manifest.json");
    ASSERT_TRUE(records.ok() && others.ok());
    for (std::size_t i = 0; i < records->layers.size(); ++i) {
      EXPECT_EQ(records->layers[i].program.bytes, others->layers[i].program.bytes);
      EXPECT_EQ(records->layers[i].program.hash, others->layers[i].program.hash);
    }
    fs::remove_all(folder_ / "small");
    fs::remove_all(folder_ / "plain");
  }
}

TEST_F(StoredJobs, ResumedShardedAndMergedJobsHaveTheSamePrograms) {
  jet("planes", "-o whole");
  jet("planes", "-o parts --shard 1/2");
  jet("planes", "-o parts --shard 2/2");
  done("merge parts -o parts --quiet");
  EXPECT_TRUE(test::tree_text(folder_ / "parts") == test::tree_text(folder_ / "whole"));
  // A frame of another level is the same program; a damaged one is made again.
  const std::string one = folder_ / "parts/program/000001.planes.zst", two = folder_ / "parts/program/000002.planes.zst";
  const std::string stored = test::read_text(two);
  test::write_text(two, stored.substr(0, stored.size() - 5));
  EXPECT_NE(refused(5, "verify parts").find("000002.planes.zst: ends within its frame"), std::string::npos);
  EXPECT_NE(refused(5, "stream parts -o new").find("000002.planes.zst: ends within its frame"), std::string::npos);
  EXPECT_FALSE(fs::exists(folder_ / "new"));
  jet("planes", "-o parts --resume");
  EXPECT_TRUE(test::tree_text(folder_ / "parts") == test::tree_text(folder_ / "whole"));
  test::write_text(one, stored);
  EXPECT_NE(refused(5, "verify parts"), "") << "the program of another layer";
  test::write_text(one, stored + "x");
  EXPECT_NE(refused(5, "verify parts").find("has bytes after its frame"), std::string::npos);
}

TEST_F(StoredJobs, AFileOfAllShardsIsComparedWhenTheyAreJoined) {
  jet("planes", "-o first --shard 1/2");
  jet("planes", "-o second --shard 2/2");
  for (const std::string name : {"end.planes.zst", "start.planes.zst", "machine.toml"}) {
    const std::string file = folder_ / ("second/program/" + name), good = test::read_text(file);
    test::write_text(file, good + "x");
    const std::string error = refused(5, "merge first second -o both");
    EXPECT_NE(error.find("second/program/" + name), std::string::npos) << error;
    EXPECT_EQ(error.find("second/second"), std::string::npos) << error;
    test::write_text(file, good);
    fs::remove_all(folder_ / "both");
  }
  done("merge first second -o both --quiet");
  const std::string end = folder_ / "both/program/end.planes.zst";
  test::write_text(end, test::read_text(end) + "x");
  const std::string error = refused(5, "stream both -o new");
  EXPECT_EQ(error.find("both/both"), std::string::npos) << error;
}

TEST_F(StoredJobs, StreamRefusesWhatIsNoWholeJob) {
  jet("planes", "-o half --layers 0:4");
  EXPECT_NE(refused(5, "stream half").find("has 4 of 11 layers"), std::string::npos);
  done("jet box.stl --bed 20x12 --dpi 100 --quiet -o images");
  EXPECT_NE(refused(2, "stream images").find("has no print program"), std::string::npos);
  refused(2, "stream absent");
  refused(2, "stream");
  jet("planes", "-o out");
  EXPECT_NE(refused(2, "stream out -o out/program/whole").find("among the files of the job"), std::string::npos);
  EXPECT_NE(refused(2, "stream out --json").find("--json"), std::string::npos);
}

TEST_F(StoredJobs, ImagesAreTheGeometryWhereDropsFollowFromIt) {
  for (const std::string dose :
       {"--saturation 37", "--core 0.5 --shell 1", "--saturation 75 --core-saturation 20 --shell 0.5 --bleed 60 --mirror x",
        "--saturation 55 --no-dither", "--job ranges.toml"}) {
    test::write_text(
        folder_ / "ranges.toml",
        "[dose]\nsaturation_percent = 40\n[[dose.saturation_range]]\nfrom_mm = 0.3\nto_mm = 0.6\nsaturation_percent "
        "= 18\n");
    jet("planes", dose + " -o mask --overwrite");
    jet("planes", dose + " --images drops -o drops --overwrite");
    EXPECT_TRUE(program_text("mask") == program_text("drops")) << dose;
    const auto mask = read_manifest(folder_ / "mask/manifest.json"), drops = read_manifest(folder_ / "drops/manifest.json");
    ASSERT_TRUE(mask.ok() && drops.ok());
    EXPECT_TRUE(mask->head.geometry && !drops->head.geometry) << dose;
    for (const LayerRecord& record : mask->layers) {
      const LayerRecord& other = drops->layers[record.layer.index];
      EXPECT_EQ(record.set_pixels, other.set_pixels) << dose;
      EXPECT_EQ(record.max_drops, other.max_drops) << dose;
      EXPECT_GE(record.geometry_pixels, record.set_pixels) << dose;
    }
    EXPECT_TRUE(fs::exists(folder_ / "mask/layers/000000.tif"));
    for (const std::string job : {"mask", "drops"}) {
      done("verify " + job + " --quiet");
      done("report " + job + " --quiet --overwrite -o page.html");
    }
    // A drop requested less, a drop jetted less, or another image of the geometry, is found.
    if (const std::uint64_t requested = mask->layers[4].requested_drops; requested > 0) {
      const std::string manifest = folder_ / "mask/manifest.json", good = test::read_text(manifest);
      std::string changed = good;
      const std::string key = "\"requested_drops\": " + std::to_string(requested);
      const std::size_t at = changed.find(key);
      ASSERT_NE(at, std::string::npos);
      test::write_text(manifest, changed.replace(at, key.size(), "\"requested_drops\": " + std::to_string(requested - 1)));
      EXPECT_NE(refused(5, "verify mask").find("drops by the job"), std::string::npos) << dose;
      test::write_text(manifest, good);
    }
    jet("planes", dose + " --blocked 60 -o less --overwrite");
    fs::copy_file(folder_ / "less/program/000004.planes.zst", folder_ / "mask/program/000004.planes.zst",
                  fs::copy_options::overwrite_existing);
    EXPECT_NE(refused(5, "verify mask").find("000004.planes.zst"), std::string::npos) << dose;
  }
}

TEST_F(StoredJobs, ImagesAreDropsWhereTheyFollowFromMore) {
  test::write_text(
      folder_ / "two.toml",
      "[machine]\nprofile = \"planes.toml\"\n[dose]\nsaturation_percent = 50\n[[part]]\npath = \"box.stl\"\nat_mm = "
      "[1, 1]\n[[part]]\npath = \"box.stl\"\nat_mm = [10.5, 1]\nsaturation_percent = 20\n");
  for (const std::string words : {"box.stl --machine planes.toml --saturation 20+x", "--job two.toml",
                                  "box.stl --machine planes.toml --levels 4", "box.stl --bed 20x12 --dpi 254 --core 0.5"}) {
    done("jet " + words + " --layer 0.1 --quiet --overwrite -o out");
    const auto manifest = read_manifest(folder_ / "out/manifest.json");
    ASSERT_TRUE(manifest.ok());
    EXPECT_FALSE(manifest->head.geometry) << words;
    EXPECT_EQ(manifest->head.format, "tiff-deflate") << words;
    done("verify out --quiet");
    EXPECT_NE(
        refused(2, "jet " + words + " --layer 0.1 --quiet --overwrite -o out --images geometry").find("--images geometry"),
        std::string::npos);
    done("jet " + words + " --layer 0.1 --quiet --overwrite -o out --format tiff-g4");
    EXPECT_EQ(read_manifest(folder_ / "out/manifest.json")->head.format, "tiff-g4") << "as named";
  }
}

TEST_F(StoredJobs, DryRunsEstimateTheFiles) {
  for (const std::string words : {"--saturation 37", "--saturation 37 --images drops", "--set program.compress=false"}) {
    jet("planes", words + " -o out --overwrite");
    std::uint64_t bytes = 0;
    for (const std::string& name : test::files_below(folder_ / "out")) bytes += fs::file_size(folder_ / ("out/" + name));
    const std::string json = done("jet box.stl --machine planes.toml --layer 0.1 --quiet --json --dry-run -o none " + words);
    const std::size_t at = json.find("\"bytes\":", json.find("\"files_estimate\""));
    ASSERT_NE(at, std::string::npos) << json;
    const std::uint64_t estimate = std::strtoull(json.c_str() + at + 8, nullptr, 10);
    EXPECT_GT(estimate, bytes / 2) << words;
    EXPECT_LT(estimate, 2 * bytes + 20'000) << words;
    EXPECT_NE(json.find("\"free_bytes\""), std::string::npos);
    EXPECT_FALSE(fs::exists(folder_ / "none"));
  }
}

TEST(Space, JobsOfWhichNotHalfFitsAreRefused) {
  using pipeline::check_space;
  std::vector<Warning> warnings;
  const pipeline::SpaceNeed need{1000, 3};
  EXPECT_TRUE(check_space(need, {"/out", 1000}, 0, false, warnings).ok());
  EXPECT_TRUE(check_space(need, {"/out", 400}, 600, false, warnings).ok()) << "files of the job itself are replaced";
  EXPECT_TRUE(warnings.empty());
  EXPECT_TRUE(check_space(need, {"/out", 500}, 0, false, warnings).ok());
  EXPECT_TRUE(check_space(need, {"/out", 10}, 0, true, warnings).ok()) << "a dry run";
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_EQ(warnings[0].code, "low-space");
  const Status refused = check_space(need, {"/out", 499}, 0, false, warnings);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().fault, Fault::kOutput);
  EXPECT_NE(refused.error().message.find("/out: the job needs about 1.0 kB"), std::string::npos) << refused.error().message;
  const auto space = pipeline::free_space("/no/such/folder/at/all");
  ASSERT_TRUE(space.has_value());
  EXPECT_EQ(space->folder, "/");
  EXPECT_GT(space->bytes, 0u);
}

}  // namespace
}  // namespace lamina
