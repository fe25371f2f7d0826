// One volume: grams, filament, porosity and E of the written file are the same material, for every printer and filling.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "pipeline/cli/command.h"
#include "pipeline/cli/console.h"
#include "pipeline/machine/profiles.h"
#include "stages/geometry/bead_section.h"
#include "tests/commands/program.h"
#include "tests/segment/gcode_reader.h"

namespace lamina::pipeline {
namespace {

struct Made {
  nlohmann::json json;
  std::string text;
};

/// Keeps what is printed.
class Listener final : public Console {
 public:
  Status print(std::string_view text) override { return said += text, Status(); }
  Status give(const Json& value) override { return said += json_text(value), Status(); }
  std::string said;
};

/// Plans a block of 14 x 11 mm, four layers high, or another part.
class Volume : public testing::Test {
 protected:
  Made extrude(const std::string& options, const std::string& part = "") {
    if (part.empty()) test::write_box(folder / "part.stl", {0, 0, 0}, {14, 11, 1.2f});
    std::vector<std::string> words = test::words_of(options);
    for (const std::string& word : {part.empty() ? folder / "part.stl" : part, std::string("--overwrite"),
                                    std::string("--json"), std::string("--quiet"), std::string("-o"), folder / "a.gcode"}) {
      words.push_back(word);
    }
    Listener console;
    const Outcome outcome = run_command(*find_command("extrude"), words, console);
    EXPECT_EQ(outcome.code, 0) << options << ": " << (outcome.error ? outcome.error->message : "");
    return {nlohmann::json::parse(console.said, nullptr, false), test::read_text(folder / "a.gcode")};
  }
  test::Directory folder;
};

/// The material of a summary in mm3: of grams, of E and of the porosity.
void expect_one_volume(const nlohmann::json& json, const Extruder& machine, const std::string& what) {
  const auto& material = machine.material;
  const double by_grams = json["filament_g"].get<double>() / material.density_g_cm3 * 1000;
  const double filament = std::numbers::pi / 4 * material.filament_mm * material.filament_mm;
  const double by_e = json["filament_mm"].get<double>() * filament * material.feed_ratio;
  const double by_porosity = (1 - json["porosity"]["by_extrusion"].get<double>()) * json["solid_mm3"].get<double>();
  const double neighbour = json["skirt"]["volume_mm3"].get<double>();
  ASSERT_GT(by_grams, 1) << what;
  EXPECT_NEAR(by_e / by_grams, 1, 1e-6) << what;
  EXPECT_NEAR((by_grams - neighbour) / by_porosity, 1, 1e-6) << what;
  EXPECT_NEAR((json["volume_mm3"].get<double>() + neighbour) / by_grams, 1, 1e-6) << what;
}

/// Walls are stated, and so drawn by a preview, as wide as a stadium of what E feeds: to the micrometre of a tag.
void expect_widths_of_what_is_fed(const test::GcodeFile& file, double feed_ratio) {
  for (const auto& layer : file.layers) {
    for (const auto& bead : layer.beads) {
      const double length = std::hypot(bead.x1 - bead.x0, bead.y1 - bead.y0);
      if (bead.type != "External perimeter" || length < 2) continue;
      const double fed = bead.filament * feed_ratio * std::numbers::pi / 4 * 1.75 * 1.75;
      ASSERT_NEAR(bead_area(bead.width, layer.height) * length / fed, 1, 0.005);
    }
  }
}

double fed_mm(const std::string& gcode, double feed_ratio = 1) {
  const test::GcodeFile file = test::read_gcode(gcode);
  EXPECT_EQ(file.error, "");
  expect_widths_of_what_is_fed(file, feed_ratio);
  double fed = 0;
  for (const auto& bead : file.skirt) fed += bead.filament;
  for (const auto& layer : file.layers) {
    for (const auto& bead : layer.beads) fed += bead.filament;
  }
  return fed;
}

TEST_F(Volume, GramsFilamentAndPorosityAreOneForEveryPrinterAndFilling) {
  const std::string fillings[] = {"--fill raster --bead-gap 0.6",
                                  "--fill raster --bead-gap 0.1,0.5 --angle-step 60 --walls 2",
                                  "--fill contour --bead-gap 0.3",
                                  "--fill honeycomb --line-distance 2",
                                  "--fill quatrefoil --line-distance 2",
                                  "--fill none --walls 3",
                                  "--fill segmented",
                                  "--fill segmented --extrusion 125 --continuous 2 --segment-rule thick-ends",
                                  "--fill segmented --pattern contour"};
  for (const ShippedProfile& shipped : shipped_extruders()) {
    const auto profile = find_extruder(std::string(shipped.name));
    ASSERT_TRUE(profile.ok());
    for (const std::string& filling : fillings) {
      const bool sml = profile->machine.format == "sml";
      const std::string what = std::string(shipped.name) + " " + filling;
      const Made made = extrude("--machine " + std::string(shipped.name) + " --layer " + (sml ? "0.254 " : "0.3 ") + filling);
      expect_one_volume(made.json, profile->machine, what);
      if (sml) continue;  // its flow is in the PD lines
      EXPECT_NEAR(fed_mm(made.text) / made.json["filament_mm"].get<double>(), 1, 1e-5) << what;
    }
  }
}

// Until now the pores of the file had a mass of their own, of rounded numbers in its comments.
TEST_F(Volume, OneMassIsReportedEverywhere) {
  for (const std::string machine : {"marlin", "anet-a8", "anet-a8 --machine-set material.feed_ratio=1.05"}) {
    const Made made = extrude("--layer 0.3 --fill segmented --machine " + machine);
    const double grams = made.json["filament_g"].get<double>();
    EXPECT_EQ(made.json["deposited"]["fed_g"].get<double>(), grams) << machine;
    EXPECT_EQ(made.json["deposited"]["fed_mm3"], made.json["filament_mm3"]) << machine;
    EXPECT_EQ(made.json["deposited"]["density_g_cm3"].get<double>(), 1.24) << machine;
    EXPECT_NEAR(made.json["filament_mm3"].get<double>() * 1.24e-3, grams, 1e-12) << machine;
    EXPECT_NE(made.text.find(fmt::format("; filament used [g] = {:.2f}\n", grams)), std::string::npos) << machine;
  }
}

TEST_F(Volume, ADeclaredErrorOfTheMachineChangesEAndNothingElse) {
  auto profile = *find_extruder("anet-a8");
  const std::string job = "--machine anet-a8 --layer 0.3 --fill segmented";
  const Made plain = extrude(job), declared = extrude(job + " --machine-set material.feed_ratio=1.05");
  profile.machine.material.feed_ratio = 1.05;
  expect_one_volume(declared.json, profile.machine, "feed_ratio");
  EXPECT_NEAR(fed_mm(plain.text) / fed_mm(declared.text, 1.05), 1.05, 1e-5);
  EXPECT_NEAR(plain.json["filament_g"].get<double>() / declared.json["filament_g"].get<double>(), 1, 1e-9);
  for (const char* key : {"porosity", "volume_mm3"}) EXPECT_EQ(plain.json[key], declared.json[key]) << key;
}

// A profile of before: E stays what it was, and the porosity is now that of what E feeds.
TEST_F(Volume, AProfileWithAFlowAloneMeansAShareOfAStadium) {
  const auto old = find_extruder("marlin");
  ASSERT_TRUE(old.ok());
  std::string text = pipeline::extruder_text(*old);
  const auto take = [&](const std::string& from, const std::string& to) { text.replace(text.find(from), from.size(), to); };
  take("bead_area = \"stadium\"\n", "");
  take("flow = 1\n", "flow = 0.9\n");
  test::write_text(folder / "old.toml", text);
  const std::string filling = " --layer 0.3 --fill raster --bead-gap 0.5";
  const Made plain = extrude("--machine marlin" + filling), share = extrude("--machine " + (folder / "old.toml") + filling);
  EXPECT_EQ(share.json["bead"]["area"], "stadium");
  EXPECT_NEAR(share.json["filament_mm"].get<double>() / plain.json["filament_mm"].get<double>(), 0.9, 1e-6);
  EXPECT_NEAR(
      (1 - share.json["porosity"]["by_extrusion"].get<double>()) / (1 - plain.json["porosity"]["by_extrusion"].get<double>()),
      0.9, 1e-6);
  EXPECT_NE(share.text.find(";WIDTH:0.366"), std::string::npos) << "as wide as what is fed: 0.9 x 0.1007 / 0.3 + 0.064";
  const auto wrong = read_extruder("[machine]\nname = \"x\"\n[material]\nbead_area = \"oval\"\n", "x.toml");
  ASSERT_FALSE(wrong.ok());
  EXPECT_NE(wrong.error().message.find("material.bead_area: unknown value 'oval'; use one of stadium, rectangle, ellipse"),
            std::string::npos)
      << wrong.error().message;
}

// 10 mm at 0.3: the 34th plane is at 10.05. 92 mm at 0.254: the 363rd layer would end at 92.202, its middle is at 92.075.
TEST_F(Volume, AnEmptyLayerAtTheTopIsNotDepositedAndIsReported) {
  for (const auto& [height, layer, count] : {std::tuple{10.0f, "0.3", 33}, {92.0f, "0.254", 362}, {9.9f, "0.3", 33}}) {
    test::write_box(folder / "cube.stl", {0, 0, 0}, {4, 4, height});
    const Made made = extrude(std::string("--fill none --walls 1 --layer ") + layer, folder / "cube.stl");
    EXPECT_EQ(made.json["layers_total"], count);
    EXPECT_EQ(made.json["layers_left_out"], height == 9.9f ? 0 : 1);
    const test::GcodeFile gcode = test::read_gcode(made.text);
    ASSERT_EQ(gcode.layers.size(), static_cast<std::size_t>(count));
    EXPECT_FALSE(gcode.layers.back().beads.empty());
  }
}

TEST_F(Volume, StepsInsideLeaveOutALayerThatEndsAboveTheParts) {
  test::write_box(folder / "cube.stl", {0, 0, 0}, {4, 4, 1});
  for (const auto& [containment, count] : {std::pair{"across", 3}, {"inside", 3}, {"outside", 4}}) {
    const std::string job = "--fill none --walls 1 --layer 0.3 --containment ";
    const Made made = extrude(job + containment, folder / "cube.stl");
    EXPECT_EQ(made.json["layers_total"], count) << containment;
    EXPECT_EQ(made.json["layers_left_out"], 4 - count) << containment;
    const test::GcodeFile gcode = test::read_gcode(made.text);
    ASSERT_EQ(gcode.layers.size(), static_cast<std::size_t>(count)) << containment;
    EXPECT_FALSE(gcode.layers.back().beads.empty()) << containment;
  }
  const Made tall = extrude("--fill none --walls 1 --layer 0.2 --containment inside", folder / "cube.stl");
  EXPECT_EQ(tall.json["layers_left_out"], 0) << "the last one ends at the top";
}

TEST_F(Volume, ALayerThatCoversTheTopIsDepositedAlsoIfItsMiddleLiesAboveThePart) {
  test::write_box(folder / "cube.stl", {0, 0, 0}, {4, 4, 1.05f});
  const std::string walls = "--fill none --walls 1 ", job = walls + "--heights angle --cover-top --thickness ";
  const Made covered = extrude(job + "0.2", folder / "cube.stl");
  EXPECT_EQ(covered.json["layers_left_out"], 0);
  EXPECT_EQ(covered.json["warnings"].dump().find("cover-top"), std::string::npos);
  const test::GcodeFile gcode = test::read_gcode(covered.text);
  ASSERT_EQ(gcode.layers.size(), 6u);
  const auto length = [](const auto& layer) {
    double sum = 0;
    for (const auto& bead : layer.beads) sum += std::hypot(bead.x1 - bead.x0, bead.y1 - bead.y0);
    return sum;
  };
  EXPECT_NEAR(length(gcode.layers[5]), length(gcode.layers[4]), 1e-6);
  // Ranges of heights end at the part's top, above which lies the middle of the layer.
  const Made ranged = extrude(job + "0.2 --set fill.range=[{from_mm=1,to_mm=1.05,walls=2}]", folder / "cube.stl");
  EXPECT_GT(length(test::read_gcode(ranged.text).layers[5]), 1.5 * length(gcode.layers[5]));
  // A pyramid 1.05 mm high is cut at 1.025 mm, in the middle of its last 0.05: 0.476 mm wide of 20.
  test::write_text(folder / "top.obj",
                   "v 0 0 0\nv 20 0 0\nv 20 20 0\nv 0 20 0\nv 10 10 1.05\nf 4 3 2 1\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 1 5\n");
  const auto volume_mm3 = [&](const std::string& command, const std::string& options) {
    Listener console;
    const auto words =
        test::words_of(options + " --json --quiet --overwrite " + (folder / "top.obj") + " -o " + (folder / "top"));
    EXPECT_EQ(run_command(*find_command(command), words, console).code, 0) << options;
    return nlohmann::json::parse(console.said, nullptr, false)["volume_mm3"].get<double>();
  };
  const std::string all = "--heights angle --cover-top --thickness 0.2", five = "--layer 0.2 --layers 0:5";
  const double side = 20 * 0.025 / 1.05, top_mm3 = 0.2 * side * side;
  EXPECT_NEAR(volume_mm3("slice", all) - volume_mm3("slice", five), top_mm3, 1e-4);
  const std::string bed = " --bed 25x25 --dpi 2540";
  EXPECT_NEAR(volume_mm3("jet", all + bed) - volume_mm3("jet", five + bed), top_mm3, 2e-3);
}

// 2.3 mm in layers of 0.3 end at 2.4: inside of the part there is no eighth one.
TEST_F(Volume, EveryPartWithLayersOfItsOwnLosesItsEmptyTop) {
  test::write_box(folder / "low.stl", {0, 0, 0}, {4, 4, 2.3f});
  test::write_box(folder / "high.stl", {0, 0, 0}, {4, 4, 5.5f});
  const Made made = extrude(
      (folder / "low.stl") + " --fill none --walls 1 --heights optimal --thickness 0.3 --per-part " + "--containment inside",
      folder / "high.stl");
  EXPECT_EQ(made.json["layers_total"], 7 + 18);
  EXPECT_EQ(made.json["layers_left_out"], 1);
}

// One stadium of 0.4 x 0.3 mm along a wall of 48.4 mm, in 14 x 11 mm.
TEST_F(Volume, PorosityIsTheShareOfTheVolumeWithinTheContours) {
  const auto json = extrude("--machine marlin --layer 0.3 --bead 0.4 --fill none --walls 1").json;
  EXPECT_NEAR(json["solid_mm3"].get<double>(), 14 * 11 * 1.2, 1e-6);
  EXPECT_NEAR(json["porosity"]["by_extrusion"].get<double>(), 1 - 48.4 * (0.03 + std::numbers::pi / 4 * 0.09) / (14 * 11 * 0.3),
              1e-6);
}

TEST_F(Volume, StepsInsideAndACoveredTopExcludeEachOther) {
  test::write_box(folder / "cube.stl", {0, 0, 0}, {4, 4, 1.05f});
  const std::string job = "--fill none --walls 1 --heights angle --cover-top --containment inside --thickness ";
  const nlohmann::json thick = extrude(job + "0.2", folder / "cube.stl").json,
                       thin = extrude(job + "0.05,0.2", folder / "cube.stl").json;
  EXPECT_EQ(thick["layers_left_out"], 1);
  const auto warned = [](const nlohmann::json& json) {
    std::string text;
    for (const auto& warning : json["warnings"])
      text += warning["code"] == "cover-top" ? warning["text"].get<std::string>() : "";
    return text;
  };
  EXPECT_NE(warned(thick).find("the topmost 0.050 mm are not built"), std::string::npos) << thick;
  EXPECT_EQ(thin["layers_left_out"], 0);
  EXPECT_EQ(warned(thin), "");
}

TEST_F(Volume, PoresReportedAreThoseThatAreDeposited) {
  const std::string examples = std::string(LAMINA_TEST_DIR) + "/../docs/examples/dinisio2022/";
  test::write_box(folder / "speed.stl", {0, 0, 0}, {62, 50, 0.3f});
  const Made speed = extrude("--job " + examples + "speed.toml", folder / "speed.stl");
  ASSERT_EQ(speed.json["pores"].size(), 1u);
  EXPECT_EQ(speed.json["pores"][0]["closed"], 0);
  EXPECT_EQ(speed.json["pores"][0]["open"], 23);  // both sides of 12 thin segments, except the one next to the wall
  EXPECT_EQ(speed.json["pores"][0]["edges"], 1);
  test::write_box(folder / "b.stl", {0, 0, 0}, {50, 28, 0.3f});
  const auto pores = extrude("--job " + examples + "B100.toml", folder / "b.stl").json["pores"][0];
  EXPECT_GT(pores["closed"], 800);
  EXPECT_EQ(pores["open"], 0);
  EXPECT_NEAR(pores["width_mm"].get<double>(), 0.077, 0.001);
  EXPECT_NEAR(pores["length_mm"].get<double>(), 1.053, 0.001);
  EXPECT_EQ(extrude("--job " + examples + "A100.toml", folder / "b.stl").json["pores"][0]["closed"], 0);
}

}  // namespace
}  // namespace lamina::pipeline
