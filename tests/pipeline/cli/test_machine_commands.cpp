// lamina machines and lamina preview --swath, as a user types them; the orientation target as a machine prints it.
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "stages/formats/images/image.h"

namespace lamina::pipeline {
namespace {

namespace fs = std::filesystem;

class MachineCommands : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "lamina_machines_XXXXXX").string();
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    directory_ = name;
  }
  void TearDown() override { fs::remove_all(directory_); }

  static std::string text(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  }
  /// What a command prints, errors too; its exit code.
  std::string lamina(const std::string& words, int expected = 0) const {
    const std::string out = (directory_ / "printed").string();
    const int status = std::system((std::string(LAMINA_PROGRAM) + " " + words + " > " + out + " 2>&1").c_str());
    EXPECT_EQ(WEXITSTATUS(status), expected) << words << "\n" << text(out);
    return text(out);
  }
  std::string at(const std::string& name) const { return (directory_ / name).string(); }
  fs::path directory_;
};

void expect_words(const std::string& text, std::initializer_list<const char*> words) {
  for (const char* const word : words) EXPECT_NE(text.find(word), std::string::npos) << word << " is not in\n" << text;
}

TEST_F(MachineCommands, CheckReportsWhatFollowsFromAProfile) {
  // 137.1 um at 45 degrees: lines of 96.944 um, 262 dpi; 4250 Hz over them 412 mm/s; 98 mm are 1011 pixels, 8 swaths of 128.
  expect_words(lamina("machines --check nuferbj"),
               {"262.006 dpi", "1.000000 pixels a nozzle", "128 lines, 12.409 mm wide", "1011 x 1011 pixels",
                "128397 bytes as bits", "8 swaths", "at most 412.0 mm/s", "s a full layer"});
  // Equation (1): tan 31 = 0.600861 and 76 steps; cos 31 of the pitch between lines.
  expect_words(lamina("machines --check nuferbj-31"), {"59.0000 degrees", "0.600861 pixels a nozzle", "76 steps", "117.5176"});
  expect_words(lamina("machines --check nuferbj-360dpi"), {"30.97", "360.000 dpi", "1.66"});
  expect_words(lamina("machines"), {"nuferbj", "nuferbj-31", "nuferbj-360dpi", "hp45", "jet1000", "production-1200"});
  EXPECT_EQ(lamina("machines --check nuferbk", 2).find('\n'), lamina("machines --check nuferbk", 2).size() - 1);
}

/// The number before a word of a printed text.
double number_before(const std::string& text, const std::string& word) {
  const std::size_t end = text.find(word);
  if (end == std::string::npos) return -1;
  const std::size_t before = text.find_last_of(" \n", end - 1);
  return std::strtod(text.c_str() + before + 1, nullptr);
}

// Beds of 30 x 24 mm, and of 30 mm: each pixel stops the head (reprap-inkjet), second passes for blocked nozzles (oasis, hp45),
// ink to be fetched (brundlefab), a round bed (nuferbj).
TEST_F(MachineCommands, CheckReportsTheTimeThatTheProgramOfAFullLayerTakes) {
  for (const std::string machine : {"reprap-inkjet", "oasis", "hp45", "brundlefab", "nuferbj"}) {
    const bool round = machine == "nuferbj";
    const double width = 30, depth = round ? 30 : 24;
    std::string profile = lamina("machines --show " + machine);
    const std::size_t size = profile.find("size_mm = ");
    profile.replace(size, profile.find('\n', size) - size, "size_mm = [30, " + std::to_string(depth) + "]");
    std::ofstream(at("m.toml")) << profile;
    // A prism over the bed, one layer high: a rectangle, or a circle of 720 corners within 2 um of its edge.
    const int corners = round ? 720 : 4;
    const auto corner = [&](int i, double z) {
      const double turn = 2 * 3.14159265358979323846 * i / corners;
      const double x = round ? 15 + 14.999 * std::cos(turn) : i % 4 == 1 || i % 4 == 2 ? width : 0;
      const double y = round ? 15 + 14.999 * std::sin(turn) : i % 4 >= 2 ? depth : 0;
      return "vertex " + std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + "\n";
    };
    std::ofstream part(at("full.stl"));
    part << "solid full\n";
    const auto facet = [&](const std::string& vertices) {
      part << "facet normal 0 0 0\nouter loop\n" << vertices << "endloop\nendfacet\n";
    };
    for (int i = 0; i < corners; ++i) {
      facet(corner(i, 0) + corner(i + 1, 0) + corner(i + 1, 0.1));
      facet(corner(i, 0) + corner(i + 1, 0.1) + corner(i, 0.1));
      if (i < 1 || i + 1 == corners) continue;
      facet(corner(0, 0) + corner(i + 1, 0) + corner(i, 0));
      facet(corner(0, 0.1) + corner(i, 0.1) + corner(i + 1, 0.1));
    }
    part << "endsolid full\n";
    part.close();
    fs::remove_all(at("full"));
    lamina("jet " + at("full.stl") + " --machine " + at("m.toml") + " --layer 0.1 -o " + at("full"));
    const std::string replayed = lamina("verify " + at("full") + " --json");
    const std::string reported = lamina("machines --check " + at("m.toml"));
    const std::size_t seconds = replayed.find("\"seconds\":"), sweeps = replayed.find("\"sweeps\":");
    ASSERT_NE(seconds, std::string::npos) << replayed;
    ASSERT_NE(sweeps, std::string::npos) << replayed;
    EXPECT_NEAR(number_before(reported, " s a full layer of 0.1 mm"), std::strtod(replayed.c_str() + seconds + 10, nullptr),
                0.051)
        << machine << "\n"
        << reported;
    EXPECT_EQ(number_before(reported, " sweeps of up to"), std::strtod(replayed.c_str() + sweeps + 9, nullptr)) << machine;
  }
}

// Twelve full layers, of which shots are due in three, wipes in two, one of them with a shot: a twelfth is reported.
TEST_F(MachineCommands, CheckAveragesMaintenanceThatIsDueEverySoManyLayers) {
  std::ofstream part(at("full.stl"));
  part << "solid full\n";
  constexpr int kFaces[12][3] = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                                 {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  for (const auto& face : kFaces) {
    part << "facet normal 0 0 0\nouter loop\n";
    for (const int corner : face) {
      part << "vertex " << (corner & 1 ? 30 : 0) << " " << (corner & 2 ? 24 : 0) << " " << (corner & 4 ? 1.2 : 0) << "\n";
    }
    part << "endloop\nendfacet\n";
  }
  part << "endsolid full\n";
  part.close();
  for (const std::string machine : {"xaar128-raw", "hp45"}) {
    std::ofstream(at("m.toml")) << "inherits = \"" << machine
                                << "\"\n[bed]\nsize_mm = [30, 24]\n[maintenance]\nspit_layers = 4\n"
                                << "spit_drops = 9000\nspit_mm = [-60, 5]\nwipe_layers = 6\nwipe_mm = [-60, 20, -60, 60]\n"
                                << "wipe_speed_mm_s = 7\n";
    fs::remove_all(at("full"));
    lamina("jet " + at("full.stl") + " --machine " + at("m.toml") + " --layer 0.1 -o " + at("full"));
    const std::string replayed = lamina("verify " + at("full") + " --json");
    const std::string reported = lamina("machines --check " + at("m.toml"));
    const auto number = [&](const std::string& key) {
      const std::size_t found = replayed.find("\"" + key + "\":");
      EXPECT_NE(found, std::string::npos) << key << replayed;
      return std::strtod(replayed.c_str() + found + key.size() + 3, nullptr);
    };
    EXPECT_EQ(number("spits"), 4) << "three, and one behind a wipe";
    EXPECT_EQ(number("wipes"), 2);
    EXPECT_NEAR(number_before(reported, " s a full layer of 0.1 mm"), number("seconds") / 12, 0.051) << machine << reported;
    EXPECT_NEAR(number_before(reported, " drops, averaged over layers"), number("spat_drops") / 12, 0.51) << reported;
    expect_words(reported, {"fired off the bed every 4 layers, wiped every 6 layers: "});
  }
}

TEST_F(MachineCommands, TheOrientationTargetIsAnFThatReadsRightOnEveryMounting) {
  lamina("machines --target " + at("f.stl"));
  for (const std::string machine : {"nuferbj", "nuferbj-31", "brundlefab", "xaar128-raw"}) {
    const std::string out = at(machine);
    lamina("jet " + at("f.stl") + " --machine " + machine + " --layer 1 -o " + out);
    lamina("verify " + out);  // what is printed is the image
    const auto image = formats::image(out + "/layers/000000.tif");
    ASSERT_TRUE(image.ok());
    const RunsView runs = image->runs;
    const double width = 25.4 / image->dpi_x, depth = 25.4 / image->dpi_y;
    std::uint32_t left = UINT32_MAX, back = UINT32_MAX;
    for (std::uint32_t r = 0; r < runs.rows(); ++r) {
      if (runs.row(r).empty()) continue;
      left = std::min(left, runs.row(r).front());
      back = std::min(back, r);
    }
    // mm to the right of the stem's left side, and from the far end to the front: row 0 is the back of the bed.
    const auto set = [&](double x, double y) {
      const auto line = runs.row(back + static_cast<std::uint32_t>((30 - y) / depth));
      const auto column = static_cast<std::uint32_t>(left + x / width);
      return (std::upper_bound(line.begin(), line.end(), column) - line.begin()) % 2 == 1;
    };
    for (const double y : {2.0, 10.0, 15.0, 20.0, 27.0}) EXPECT_TRUE(set(3, y)) << machine << " stem at " << y;
    EXPECT_TRUE(set(17, 27)) << machine << ": the far arm is the long one";
    EXPECT_TRUE(set(12, 15)) << machine;
    EXPECT_FALSE(set(17, 15)) << machine << ": the near arm is short";
    EXPECT_FALSE(set(12, 3)) << machine << ": no arm at the foot";
    EXPECT_FALSE(set(12, 21)) << machine;
    // The step on top is at the foot: the third layer holds nothing else.
    const auto top = formats::image(out + "/layers/000002.tif");
    ASSERT_TRUE(top.ok());
    for (std::uint32_t r = 0; r < runs.rows(); ++r) {
      const bool foot = r > back + static_cast<std::uint32_t>(23.5 / depth);
      EXPECT_TRUE(foot || top->runs.view().row(r).empty()) << machine << " row " << r;
    }
    EXPECT_GT(set_pixels(top->runs), 0u);
  }
}

TEST_F(MachineCommands, PreviewShowsALayerAtAStepOfASwath) {
  const std::string part = std::string(LAMINA_TEST_DIR) + "/corpus/parameter_quality_nut.stl";
  lamina("jet " + part + " " + part + " --material steel,bronze --machine nuferbj --vat-rule majority --layer 4 -o " +
         at("out"));
  const auto picture = [&](const std::string& options, int expected = 0) {
    fs::remove(at("p.png"));
    const std::string said =
        lamina("preview " + at("out") + " -o " + at("p.png") + " --layer 1 --width 600 " + options, expected);
    return expected == 0 ? text(at("p.png")) : said;
  };
  const std::string early = picture("--swath 4 --step 480"), late = picture("--swath 4 --step 640"),
                    middle = picture("--swath middle");
  for (const std::string& one : {early, late, middle}) EXPECT_EQ(one.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_NE(early, late);
  expect_words(picture("--swath 0", 2), {"--swath 0: fires nothing in layer 1; those that do are"});
  expect_words(picture("--swath 4 --step 99999", 2), {"--step 99999: swath 4 of layer 1 fires at steps "});
  expect_words(lamina("preview " + at("out") + " -o " + at("p.png") + " --swath 4 --layer 99", 2),
               {"--layer 99: the job has layers 0 to "});
}

TEST_F(MachineCommands, WhatAJobCannotReportOrJetIsSaid) {
  const std::string nut = std::string(LAMINA_TEST_DIR) + "/corpus/parameter_quality_nut.stl ";
  expect_words(lamina("jet " + nut + "--machine jet1000 --layer 4 --core 0 --shell 1 -o " + at("shell")), {"layers"});
  expect_words(lamina("jet " + nut + "--dpi 100 --layer 4 --core 0 --shell 0.2 --allow-empty -o " + at("thin")),
               {"dose.core: 0 without a shell", " 0 set"});
  const std::string words = lamina("verify " + at("shell"));
  expect_words(words, {"the program does not move powder, its time is the profile's", "ml of binder"});
  EXPECT_EQ(words.find("powder fed"), std::string::npos) << words;
  lamina("jet " + nut + "--machine hp45 --layer 4 -o " + at("hp45"));
  expect_words(lamina("verify " + at("hp45")), {" s) on hp45: ", " m other travel", "powder fed"});
  expect_words(lamina("jet " + nut + "--machine hp45 --layer 4 --core 0 --allow-empty -o " + at("none")),
               {"dose.core: 0 without a shell"});
  expect_words(lamina("jet " + nut + "--machine hp45 --layer 4 --scale 20 -o " + at("large"), 2),
               {"use another machine or a smaller --scale"});
  expect_words(lamina("extrude " + nut + "--scale 20 -o " + at("large.gcode"), 2),
               {"use another machine or a smaller --scale"});
}

}  // namespace
}  // namespace lamina::pipeline
