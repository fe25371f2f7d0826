// lamina verify of toolpath files: by the manifest, by a new plan, by a model, and of other programs.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

class VerifiedToolpaths : public ::testing::Test {
 protected:
  VerifiedToolpaths() {
    write_one_of_each_kind(folder_);
    const Outcome made = run("extrude part.stl --layer 0.2 --density 30 -o part.gcode");
    EXPECT_EQ(made.code, 0) << made.err;
    text_ = read_text(folder_.path() / "part.gcode");
  }
  Outcome run(const std::string& line) const { return run_lamina(words_of(line), folder_.path()); }
  Outcome verify(const std::string& text, const std::string& options = "") const {
    write_text(folder_.path() / "part.gcode", text);
    return run("verify part.gcode " + options);
  }
  /// The position of a text in a layer, from 0.
  std::size_t in_layer(int layer, const std::string& what) const {
    std::size_t at = 0;
    for (int i = 0; i <= layer; ++i) at = text_.find(";LAYER_CHANGE", at + 1);
    return text_.find(what, at);
  }

  /// Without the beads of a type's first path in a layer.
  std::string without_path(int layer, const std::string& type) const {
    std::string text = text_;
    std::size_t at = text.find("G1 X", in_layer(layer, ";TYPE:" + type));
    while (text.compare(at, 4, "G0 X") != 0 && text.compare(at, 5, "G1 E-") != 0) {
      const std::size_t end = text.find('\n', at) + 1;
      if (text.compare(at, 4, "G1 X") == 0) {
        text.erase(at, end - at);
      } else {
        at = end;
      }
    }
    return text;
  }

  Directory folder_;
  std::string text_;
};

TEST_F(VerifiedToolpaths, AreReplayedAndComparedWithTheirManifest) {
  const Outcome good = run("verify part.gcode --json");
  EXPECT_EQ(good.code, 0) << good.err;
  const auto json = nlohmann::json::parse(good.out);
  EXPECT_TRUE(json.at("ok"));
  const auto& replay = json.at("toolpaths");
  EXPECT_EQ(replay.at("machine"), "Marlin");
  EXPECT_TRUE(replay.at("defects").empty()) << replay.at("defects");
  EXPECT_NEAR(replay.at("seconds").get<double>(), replay.at("stated_seconds").get<double>(),
              0.01 * replay.at("seconds").get<double>() + 0.5);
  const Outcome quick = run("verify part.gcode --quick");
  EXPECT_EQ(quick.code, 0);
  EXPECT_EQ(quick.out.find("filament"), std::string::npos);
}

TEST_F(VerifiedToolpaths, OfAnotherContentAreComparedWithANewPlan) {
  EXPECT_NE(verify(text_, "--parts .").out.find("0 missing, 0 not planned, 0 changed"), std::string::npos);
  // One inner wall of a layer.
  const std::string lacking = without_path(5, "Perimeter");
  const Outcome missing = verify(lacking);
  EXPECT_EQ(missing.code, 5);
  EXPECT_NE(missing.err.find("layer 5: missing beads: 4, "), std::string::npos) << missing.err;
  EXPECT_NE(missing.err.find("the first, Perimeter, at"), std::string::npos) << missing.err;
  // Another amount of filament.
  std::string wide = text_;
  const std::size_t bead = wide.find(" E", in_layer(6, ";TYPE:Perimeter"));
  wide.insert(bead + 2, "1");
  EXPECT_NE(verify(wide).err.find("layer 6: beads of another width or volume: 1"), std::string::npos);
  // A layer.
  std::string low = text_;
  low.erase(in_layer(7, ";Z:") - 14, in_layer(8, ";Z:") - in_layer(7, ";Z:"));
  EXPECT_NE(verify(low).err.find("layer 7: is missing"), std::string::npos);
  // Where the part is not there, the plan is not compared, and the hash is.
  fs::rename(folder_.path() / "part.stl", folder_.path() / "other.stl");
  const Outcome alone = verify(lacking);
  EXPECT_EQ(alone.code, 5);
  EXPECT_NE(alone.out.find("part.stl was not found; name its folder by --parts"), std::string::npos) << alone.out;
}

TEST_F(VerifiedToolpaths, OfOtherProgramsAreReplayedAlone) {
  fs::remove(folder_.path() / "part.gcode.json");
  EXPECT_EQ(verify(text_).code, 0);
  const Outcome small = verify(text_, "--machine marlin");
  EXPECT_EQ(small.code, 0) << small.err;
  EXPECT_EQ(verify("G28\nM109 S10\nG90\n" + text_.substr(text_.find("M83"))).code, 5);
  expect_refused("verify part.stl", 2, "part.stl", folder_);
  expect_refused("verify part.gcode --machine unknown", 2, "unknown", folder_);
  expect_refused("verify part.gcode --filament 0", 2, "--filament", folder_);
  expect_refused("verify part.gcode --material petg", 2, "--material: needs --machine", folder_);
  expect_refused("verify . --model part.stl", 2, "--model: is of G-code files", folder_);
}

TEST_F(VerifiedToolpaths, HaveTheWallsOfAModel) {
  fs::remove(folder_.path() / "part.gcode.json");
  const Outcome good = verify(text_, "--model part.stl --json");
  EXPECT_EQ(good.code, 0) << good.err;
  const auto model = nlohmann::json::parse(good.out).at("toolpaths").at("model");
  EXPECT_TRUE(model.at("compared")) << model;
  EXPECT_EQ(model.at("min_outline"), 1);
  const std::string lacking = without_path(5, "External perimeter");
  const Outcome missing = verify(lacking, "--model part.stl");
  EXPECT_EQ(missing.code, 5);
  EXPECT_NE(missing.err.find("layer 5: 0 % of the model's outline have an outer wall"), std::string::npos) << missing.err;
}

}  // namespace
}  // namespace lamina::test
