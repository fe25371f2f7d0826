// The remains of a refused job, and the report of one of a range of layers.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

class RefusedJobs : public testing::Test {
 protected:
  RefusedJobs() { test::write_box(folder_ / "box.stl", {0, 0, 0}, {2, 3, 4}); }
  test::Outcome lamina(const std::string& line) const { return test::run_lamina(test::words_of(line), folder_.path()); }
  void save(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  bool is_there(const std::string& name) const { return fs::exists(folder_ / name); }
  std::string text_of(const std::string& name) const {
    std::ifstream file(folder_ / name);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  test::Directory folder_;
};

TEST_F(RefusedJobs, SaveNoJob) {
  save("weak.toml", "inherits = \"jet1000\"\n[machine]\nname = \"weak\"\n[powder]\nmin_saturation_percent = 50\n");
  const std::string refused = "jet box.stl --layer 0.1 --machine weak.toml --saturation 20 --save-job job.toml ";
  for (const char* how : {"-o out", "--dry-run"}) {
    EXPECT_EQ(lamina(refused + how).code, 2);
    EXPECT_FALSE(is_there("job.toml"));
    EXPECT_FALSE(is_there("out"));
  }
  const std::string taken = "jet box.stl --layer 0.1 --machine weak.toml --saturation 60 --quiet --save-job job.toml ";
  ASSERT_EQ(lamina(taken + "--dry-run").code, 0);
  const std::string before = text_of("job.toml");
  EXPECT_NE(before.find("saturation_percent = 60"), std::string::npos);
  EXPECT_EQ(lamina(refused + "-o out").code, 2);
  EXPECT_EQ(text_of("job.toml"), before);
  for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path()))
    EXPECT_EQ(entry.path().string().find(".part"), std::string::npos) << entry.path();
  ASSERT_EQ(lamina("jet box.stl --layer 0.1 --dpi 300 --bed 5x5 --quiet --save-job other.toml -o out").code, 0);
  EXPECT_TRUE(is_there("other.toml"));
}

// Nor do commands that plan no layers.
TEST_F(RefusedJobs, OfPartsThatCannotBeLoadedSaveNone) {
  save("bad.stl", "no mesh at all\n");
  const std::string commands[] = {"export @ --quiet --overwrite -o x.stl", "heights @ --layer 1 --quiet",
                                  "jet @ --layer 1 --quiet --dry-run", "slice @ --layer 1 --quiet --dry-run",
                                  "extrude @ --layer 0.3 --quiet --dry-run"};
  for (std::string line : commands) {
    line += " --save-job job.toml";
    const std::size_t part = line.find('@');
    fs::remove(folder_ / "job.toml");
    EXPECT_EQ(lamina(std::string(line).replace(part, 1, "bad.stl")).code, 3) << line;
    EXPECT_FALSE(is_there("job.toml")) << line;
    ASSERT_EQ(lamina(std::string(line).replace(part, 1, "box.stl")).code, 0) << line;
    const std::string before = text_of("job.toml");
    EXPECT_NE(before.find("box.stl"), std::string::npos) << line;
    EXPECT_EQ(lamina(std::string(line).replace(part, 1, "bad.stl")).code, 3) << line;
    EXPECT_EQ(text_of("job.toml"), before) << line;
  }
  // A table that cannot be measured is found behind the mesh.
  fs::remove(folder_ / "job.toml");
  save("tops.txt", "no table\n");
  EXPECT_NE(lamina("heights box.stl --measure tops.txt --layer 1 --quiet --save-job job.toml").code, 0);
  EXPECT_FALSE(is_there("job.toml"));
}

TEST_F(RefusedJobs, OfAnErrorInALayerLeaveNothingButWhatOthersMade) {
  const std::string size = " --layer 0.1 --dpi 300 --bed 5x5 --format pbm ";
  ASSERT_EQ(lamina("jet box.stl" + size + "-o made --quiet").code, 0);
  fs::remove(folder_ / "made/manifest.json");
  const std::string whole = text_of("made/layers/000030.pbm");
  save("made/layers/000030.pbm", whole.substr(0, whole.size() / 2));
  const std::string job = "jet made/layers" + size;
  const test::Outcome failed = lamina(job + "-o out");
  if (failed.code == 0 || failed.err.find("000030") == std::string::npos) FAIL() << failed.err;
  EXPECT_EQ(failed.code, 3);
  EXPECT_FALSE(is_there("out"));
  // Another shard's layers stay.
  ASSERT_EQ(lamina(job + "--shard 1/4 -o out --quiet").code, 0);
  EXPECT_EQ(lamina(job + "--shard 4/4 -o out").code, 3);
  EXPECT_TRUE(is_there("out/layers/000000.pbm") && is_there("out/manifest-1-of-4.json"));
}

TEST_F(RefusedJobs, LayersOfOtherRunsAreNotWarnedOf) {
  save("thick.toml", "inherits = \"jet1000\"\n[machine]\nname = \"thick\"\n[head]\nmax_drop_sweeps = 1\n");
  const std::string job = "jet box.stl --layer 0.1 --machine thick.toml --saturation 300 --dry-run ";
  EXPECT_NE(lamina(job).err.find("layers 0:40 "), std::string::npos) << lamina(job).err;
  EXPECT_NE(lamina(job + "--layers 3:9").err.find("layers 3:9 "), std::string::npos) << lamina(job + "--layers 3:9").err;
  EXPECT_NE(lamina(job + "--shard 2/4").err.find("layers 10:20 "), std::string::npos) << lamina(job + "--shard 2/4").err;
}

TEST_F(RefusedJobs, PausesForVatsAreThoseOfTheLayersThatAreMade) {
  save("low.toml", "inherits = \"nuferbj\"\n[machine]\nname = \"low\"\n[powder]\nvat_depth_mm = [1, 1]\nrefill = \"pause\"\n");
  const auto reported = [&](const std::string& how) {
    return lamina("jet box.stl --layer 0.1 --machine low.toml --dry-run " + how).err;
  };
  const std::string all = reported("");
  ASSERT_NE(all.find("pauses before layers 8, 16, 24 and 32 "), std::string::npos) << all;
  EXPECT_NE(reported("--layers 10:20").find("pauses before layer 16 "), std::string::npos) << reported("--layers 10:20");
  EXPECT_EQ(reported("--layers 1:8").find("pauses"), std::string::npos);
}

}  // namespace
}  // namespace lamina::pipeline
