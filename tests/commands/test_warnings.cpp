// Jobs that plan something else than their parts: reported with a code, refused if empty, errors if strict.
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Codes = std::vector<std::string>;

class Warnings : public ::testing::Test {
 protected:
  Warnings() {
    write_box(directory_ / "part.stl", {0, 0, 0}, {20, 10, 5});
    write_box(directory_ / "pin.stl", {0, 0, 0}, {0.3f, 0.3f, 5});
  }

  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }
  /// The codes of a job that is done.
  Codes reported(const std::string& line) {
    const Outcome outcome = run(line + " --json");
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    summary_ = Json::parse(outcome.out, nullptr, false);
    Codes codes;
    for (const Json& warning : summary_["warnings"]) {
      codes.push_back(warning["code"]);
      EXPECT_NE(outcome.err.find(warning["text"].get<std::string>()), std::string::npos) << outcome.err;
    }
    return codes;
  }
  /// The job is refused with one line, and no file of it stays.
  void refused(const std::string& line, int code, const Codes& words) {
    const std::string before = tree_text(directory_.path());
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, code) << line << "\n" << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << line << "\n" << outcome.err;
    for (const std::string& word : words) EXPECT_NE(outcome.err.find(word), std::string::npos) << line << "\n" << outcome.err;
    EXPECT_EQ(tree_text(directory_.path()), before) << line;
  }

  Directory directory_;
  Json summary_;
};

TEST_F(Warnings, SoundJobsHaveNone) {
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 100 -o a"), Codes());
  EXPECT_EQ(reported("jet part.stl part.stl --copies 3 --layer 0.5 --dpi 100 --bleed 100 --mirror x -o b"), Codes());
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 100 --fill raster --bead 0.5 --bead-gap 1 -o c"), Codes());
  EXPECT_EQ(reported("slice part.stl --layer 0.5 --tolerance 20 -o d"), Codes());
  EXPECT_EQ(reported("extrude part.stl --machine anet-a8 --layer 0.25 -o e.gcode"), Codes());
  EXPECT_EQ(reported("jet part.stl --layer 0.4 --dpi 100 -o f"), Codes()) << "the top ends amid a layer";
}

TEST_F(Warnings, OddJobsHaveACodeAndAPosition) {
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 1 -o a"), Codes{"volume"});
  EXPECT_EQ(summary_["warnings"][0]["part"], "part.stl");
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 1 --layers 0: -o a1"), Codes()) << "some layers only";
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 100 --bleed 2000 -o b"), Codes{"bleed"});
  EXPECT_EQ(reported("slice part.stl --layer 0.5 --tolerance 900 -o c"), Codes{"tolerance"});
  EXPECT_EQ(reported("slice part.stl --layer 0.5 --pattern raster --bead 50 -o d"), Codes{"no-bead"});
  EXPECT_EQ(reported("extrude part.stl --machine anet-a8 --layer 0.25 --bottom 5 -o e.gcode"),
            (Codes{"overhangs", "above-bed"}));
  EXPECT_EQ(summary_["warnings"][0]["z_mm"], 5.125);
  EXPECT_EQ(summary_["warnings"][1]["z_mm"], 5.0);
}

TEST_F(Warnings, APartAmongOthersThatIsLost) {
  write_text(directory_ / "job.toml",
             "[layers]\nthickness_mm = 0.5\n[bed]\ndpi = 20\n[[part]]\npath = \"part.stl\"\nat_mm = [1, 1]\n"
             "[[part]]\npath = \"pin.stl\"\nat_mm = [30.5, 1.28]\n");
  EXPECT_EQ(reported("jet --job job.toml -o a"), Codes{"part-lost"});
  EXPECT_TRUE(summary_["warnings"][0]["part"].get<std::string>().ends_with("pin.stl"));
}

TEST_F(Warnings, EmptyJobsAreRefusedUnlessAllowed) {
  refused("jet part.stl --layer 100 --dpi 60 -o a", 3, {"not one pixel in 1 layer,", "--layer", "--allow-empty"});
  refused("jet part.stl --layer 0.5 --dpi 60 --bleed 6000 -o a", 3, {"--bleed"});
  refused("jet part.stl --layer 0.5 --machine nuferbj --bleed 9000 -o a", 3, {"--bleed"});
  refused("jet part.stl --layer 1 --dpi 60 --scale 0.001 -o a", 3, {"--dpi"});
  refused("extrude part.stl --machine anet-a8 --walls 0 --fill none -o a.gcode", 3, {"not one bead", "--walls"});
  refused("extrude part.stl --machine anet-a8 --bead 45 -o a.gcode", 3, {"no bead fits"});
  refused("slice part.stl --layer 1 --offset -9 -o a", 3, {"not one contour", "--offset -9"});
  EXPECT_EQ(reported("jet part.stl --layer 100 --dpi 60 --allow-empty -o a"), Codes{"empty"});
  EXPECT_EQ(reported("extrude part.stl --machine anet-a8 --walls 0 --fill none --allow-empty -o a.gcode"),
            (Codes{"no-bead", "empty"}));
  EXPECT_EQ(reported("jet part.stl --layer 100 --dpi 60 --shard 1/1 -o s"), Codes()) << "shards may be empty";
  EXPECT_EQ(reported("jet part.stl --layer 100 --dpi 60 --layers 0: -o l"), Codes()) << "and some layers";
  write_text(directory_ / "empty.toml",
             "[run]\nallow_empty = true\n[layers]\nthickness_mm = 100\n[[part]]\npath = \"part.stl\"\n");
  EXPECT_EQ(reported("jet --job empty.toml --dpi 60 -o j"), Codes{"empty"});
}

TEST_F(Warnings, StrictJobsEndAtAWarning) {
  refused("jet part.stl --layer 0.5 --dpi 100 --bleed 2000 --strict -o a", 5, {"--strict: 1 warning; [bleed]"});
  refused("slice part.stl --layer 0.5 --tolerance 900 --strict -o a", 5, {"[tolerance]"});
  refused("extrude part.stl --machine anet-a8 --bottom 5 --strict -o a.gcode", 5, {"[above-bed]"});
  refused("extrude part.stl --machine anet-a8 --walls 0 --fill none --dry-run --strict", 5, {"[no-bead]"});
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 100 --strict -o b"), Codes());
}

TEST_F(Warnings, NoFolderOfARefusedJobStays) {
  fs::create_directory(directory_ / "mine");
  refused("jet part.stl --layer 100 --dpi 60 -o deep/a/b", 3, {"not one pixel"});
  refused("slice part.stl --layer 1 --offset -9 --file-a-layer -o deep/c", 3, {"not one contour"});
  refused("jet part.stl --layer 0.5 --dpi 100 --bleed 2000 --strict -o mine/a", 5, {"[bleed]"});
  refused("jet part.stl --layer 100 --dpi 60 -o mine", 3, {"not one pixel"});
  EXPECT_FALSE(fs::exists(directory_ / "deep"));
  EXPECT_TRUE(fs::is_empty(directory_ / "mine")) << "it was there before";
}

TEST_F(Warnings, AMergedJobIsCheckedAsAWhole) {
  const auto shards = [&](const std::string& job, const std::string& out) {
    for (const char* one : {" --shard 1/2 -o ", " --shard 2/2 -o "}) EXPECT_EQ(reported(job + one + out), Codes());
  };
  shards("jet part.stl --layer 2.5 --dpi 60 --bleed 9000", "none");
  refused("merge none -o none", 3, {"not one pixel in 2 layers", "--allow-empty"});
  refused("merge none -o other", 3, {"not one pixel"});
  EXPECT_FALSE(fs::exists(directory_ / "other"));
  refused("merge none -o other --allow-empty --strict", 5, {"--strict: 1 warning; [empty]"});
  EXPECT_EQ(reported("merge none -o none --allow-empty"), Codes{"empty"});
  EXPECT_EQ(reported("merge none -o none"), Codes{"empty"}) << "whole already";

  // The pin stands between two blocks, and is thinner than a pixel.
  write_text(directory_ / "job.toml",
             "[layers]\nthickness_mm = 1\n[bed]\ndpi = 20\n[[part]]\npath = \"neck.obj\"\nat_mm = [1, 1]\n");
  std::string text;
  auto block = [&, vertices = 0](double side, double low, double high) mutable {
    for (const double z : {low, high}) {
      for (const double y : {5 - side, 5 + side}) {
        for (const double x : {5 - side, 5 + side})
          text += "v " + std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
      }
    }
    for (const auto& [a, b, c, d] :
         {std::array{1, 3, 4, 2}, {5, 6, 8, 7}, {1, 2, 6, 5}, {3, 7, 8, 4}, {1, 5, 7, 3}, {2, 4, 8, 6}}) {
      text += "f";
      for (const int corner : {a, b, c, d}) text += " " + std::to_string(vertices + corner);
      text += "\n";
    }
    vertices += 8;
  };
  block(5, 0, 2);
  block(0.1, 2, 5);
  block(5, 5, 7);
  write_text(directory_ / "neck.obj", text);
  EXPECT_EQ(run("jet --job job.toml -o whole").code, 0);
  EXPECT_EQ(reported("jet --job job.toml --engine rays -o neck_rays"), Codes{"layers-empty"});
  EXPECT_EQ(reported("jet --job job.toml --engine contours -o neck_contours"), Codes{"layers-empty"});
  shards("jet --job job.toml", "neck");
  refused("merge neck -o neck --strict", 5, {"[layers-empty]"});
  EXPECT_EQ(reported("merge neck -o neck"), Codes{"layers-empty"});
  EXPECT_EQ(summary_["warnings"][0]["layer"], 2);
  EXPECT_EQ(summary_["warnings"][0]["z_mm"], 2.5);
  EXPECT_EQ(tree_text(directory_ / "neck"), tree_text(directory_ / "whole"));
}

TEST_F(Warnings, NeitherKeyMakesAnotherJob) {
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 100 -o a"), Codes());
  EXPECT_EQ(reported("jet part.stl --layer 0.5 --dpi 100 --strict --allow-empty -o b"), Codes());
  EXPECT_EQ(read_text(directory_.path() / "a/manifest.json"), read_text(directory_.path() / "b/manifest.json"));
  EXPECT_EQ(run("jet part.stl --layer 0.5 --dpi 100 --strict -o a --resume").code, 0);
}

TEST_F(Warnings, ABatchCountsThem) {
  write_text(directory_ / "list.txt", "jet part.stl --layer 0.5 --dpi 100\njet part.stl --layer 0.5 --dpi 100 --bleed 2000\n");
  const Outcome outcome = run("batch list.txt -o out --json");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const Json json = Json::parse(outcome.out);
  EXPECT_EQ(json["warnings"], 1);
  EXPECT_EQ(json["jobs"][1]["result"]["warnings"][0]["code"], "bleed");
  EXPECT_NE(outcome.err.find("1 warning"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace lamina::test
