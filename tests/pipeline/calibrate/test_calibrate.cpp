// lamina calibrate: its test pieces, and profiles from the document's own measurements.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "pipeline/machine/profiles.h"
#include "pipeline/plan/segment.h"
#include "tests/commands/program.h"
#include "tests/segment/gcode_reader.h"
#include "tests/segment/table.h"

namespace lamina {
namespace {

namespace fs = std::filesystem;
using test::number;

class CalibrateProgram : public testing::Test {
 protected:
  test::Outcome run(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), "calibrate");
    return test::run_lamina(arguments, folder.path());
  }
  /// Tables 11 to 15 as a person would fill them in: all thick speeds that were tried.
  std::string measured() {
    std::string text =
        "test,percent,thick_speed_percent,region,wall_mm,thick_mm,thin_mm,continuous_mm,stable_mm\nflow,,,,0.94,,,,\n";
    for (const auto& row : test::table(11)) {
      text += "speed," + row.at("thin_speed_percent") + ",,,," + row.at("thick_width_max_mm") + "," +
              row.at("thin_width_min_mm") + ",," + row.at("stabilisation_distance_mm") + "\n";
    }
    for (const auto& row : test::table(12))
      text += "extrusion," + row.at("thin_extrusion_percent") + ",,,,," + row.at("thin_width_min_mm") + ",,\n";
    for (const auto& [table, speed] : {std::pair{13, "100"}, {14, "75"}, {15, "50"}}) {
      for (const auto& row : test::table(table)) {
        text += "repeated," + row.at("sample").substr(1) + "," + speed + "," + row.at("region") + ",," + row.at("thick_mm") +
                "," + row.at("thin_mm") + "," + row.at("continuous_mm") + ",\n";
      }
    }
    return text;
  }
  test::Directory folder;
};

TEST_F(CalibrateProgram, TheDocumentsOwnWidthsGiveItsOwnSpeedsAndSpacings) {
  test::write_text(folder / "widths.csv", measured());
  const auto outcome = run({"--measured", "widths.csv", "--machine", "anet-a8", "-o", "own.toml", "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["warnings"].size(), 0) << outcome.out;
  const auto wanted = test::table(7);
  ASSERT_EQ(json["repeated"].size(), 3);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(json["repeated"][i]["extrusion_percent"], number(wanted[i], "extrusion_percent"));
    EXPECT_EQ(json["repeated"][i]["thick_speed_percent"], number(wanted[i], "thick_speed_percent"));
    EXPECT_NEAR(json["repeated"][i]["spacing_sc_mm"].get<double>(), number(wanted[i], "spacing_sc_mm"), 1e-9);
    EXPECT_NEAR(json["repeated"][i]["spacing_cc_mm"].get<double>(), 0.40, 1e-9);
    EXPECT_NEAR(json["repeated"][i]["deviation_mm"].get<double>(), 0.01, 1e-9);
  }
  EXPECT_NEAR(json["flow"].get<double>(), 0.85 * 0.8 / 0.94, 0.001);

  // The planner takes them in place of its own tables.
  const auto profile = pipeline::find_extruder(folder / "own.toml");
  ASSERT_TRUE(profile.ok()) << profile.error().message;
  EXPECT_TRUE(profile->own_calibration);
  for (const auto& row : test::table(11)) {
    EXPECT_DOUBLE_EQ(segment::stable_distance(profile->calibration, number(row, "thin_speed_percent")).value,
                     number(row, "stabilisation_distance_mm"));
  }
  for (const auto& row : test::table(12)) {
    EXPECT_DOUBLE_EQ(segment::thin_width_at_extrusion(profile->calibration, number(row, "thin_extrusion_percent")).value,
                     number(row, "thin_width_min_mm"));
  }
  for (const auto& row : wanted) {
    pipeline::SegmentRequest request;
    request.all.on = true;
    request.all.thick_extrusion = number(row, "extrusion_percent");
    pipeline::FillRequest fill;
    const auto plan = pipeline::plan_segments(request, profile->calibration, fill);
    ASSERT_TRUE(plan.ok()) << plan.error().message;
    EXPECT_NEAR(plan->base.plan.spacing_sc_mm, number(row, "spacing_sc_mm"), 1e-9);
    EXPECT_EQ(plan->base.plan.thick_speed, number(row, "thick_speed_percent"));
  }
}

TEST_F(CalibrateProgram, WidthsThatStillChangeAlongThePartAreToBePrintedAgain) {
  std::string text = "test,percent,thick_speed_percent,region,thick_mm,thin_mm,continuous_mm\n";
  for (const auto& row : test::table(13)) {
    if (row.at("sample") == "A125")
      text += "repeated,125,100," + row.at("region") + "," + row.at("thick_mm") + "," + row.at("thin_mm") + "," +
              row.at("continuous_mm") + "\n";
  }
  test::write_text(folder / "widths.csv", text);
  const auto outcome = run({"--measured", "widths.csv", "--machine", "anet-a8", "-o", "own.toml"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_NE(outcome.err.find("extrusion 125 %: widths change by 0.100 mm along the part at 100 % of the speed"),
            std::string::npos)
      << outcome.err;
}

TEST_F(CalibrateProgram, WrongTablesAreOneLineThatNamesThePosition) {
  const auto message = [&](const std::string& text, int code = 3) {
    test::write_text(folder / "widths.csv", text);
    const auto outcome = run({"--measured", "widths.csv", "--machine", "anet-a8", "-o", "own.toml", "--quiet"});
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(folder / "own.toml"));
    return outcome.err;
  };
  EXPECT_NE(message("test,percent,thin_mm\nextrusion,90,thin\n").find("widths.csv:2: thin_mm: "), std::string::npos);
  EXPECT_NE(message("test,percent,thin_mm\nextrusion,90,-0.1\n").find("widths.csv:2: thin_mm: "), std::string::npos);
  EXPECT_NE(message("test,percent,thin_mm\nextrussion,90,0.1\n").find("did you mean 'extrusion'?"), std::string::npos);
  EXPECT_NE(message("test,percent,thin\nextrusion,90,0.1\n").find("widths.csv:1: "), std::string::npos);
  EXPECT_NE(message("test,percent,thin_mm\nextrusion,90\n").find("2 columns where the header has 3"), std::string::npos);
  EXPECT_NE(message("test,percent,thin_mm\nspeed,200,0.2\n").find("stable_mm is empty"), std::string::npos);
  EXPECT_NE(message("test,percent,thin_mm\nextrusion,90,\n").find("contains no widths"), std::string::npos);
  EXPECT_NE(message("").find("contains no rows"), std::string::npos);
}

TEST_F(CalibrateProgram, PiecesAreThoseOfTheDocumentAndTheirFilesBelongTogether) {
  const auto outcome = run({"--machine", "anet-a8", "-o", "pieces", "--json", "--quiet"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto names = nlohmann::json::parse(outcome.out)["pieces"];
  EXPECT_EQ(names.size(), 16);
  const auto thin_feeds = [&](const std::string& name) {
    std::vector<double> feeds;
    const auto gcode = test::read_gcode(test::read_text(folder / ("pieces/" + name + ".gcode")));
    EXPECT_EQ(gcode.error, "") << name;
    for (const auto& bead : gcode.layers[0].beads) {
      if (bead.feed > 900) feeds.push_back(bead.feed);
    }
    return feeds;
  };
  EXPECT_EQ(thin_feeds("4-speed").size(), 12);
  EXPECT_EQ(thin_feeds("4-extrusion").size(), 0);
  EXPECT_EQ(thin_feeds("3-level").size(), 0);
  EXPECT_GT(thin_feeds("6-layer-1-100").size(), 100);
  const auto level = test::read_gcode(test::read_text(folder / "pieces/3-level.gcode"));
  std::size_t lines = 0;
  for (const auto& bead : level.layers[0].beads) lines += std::hypot(bead.x1 - bead.x0, bead.y1 - bead.y0) > 90 ? 1 : 0;
  EXPECT_EQ(lines, 20);
  const auto flow = test::read_gcode(test::read_text(folder / "pieces/2-flow.gcode"));
  EXPECT_EQ(flow.layers.size(), 34);
  EXPECT_EQ(flow.layers[0].beads.size(), 8);
  // The job file is the piece.
  const auto again = test::run_lamina(
      {"extrude", "--job", folder / "pieces/4-speed.toml", "-o", folder / "again.gcode", "--quiet"}, folder.path());
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(test::read_text(folder / "again.gcode"), test::read_text(folder / "pieces/4-speed.gcode"));
  // Measurements are never written over.
  const auto twice = run({"--machine", "anet-a8", "-o", "pieces"});
  EXPECT_EQ(twice.code, 2);
  EXPECT_NE(twice.err.find("widths.csv"), std::string::npos);
}

}  // namespace
}  // namespace lamina
