// The samples of Di Nisio 2022, Tables 3 to 8, planned from the job files of docs/examples/dinisio2022 and read back.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/commands/program.h"
#include "tests/segment/cylinder.h"
#include "tests/segment/gcode_reader.h"
#include "tests/segment/table.h"

namespace lamina {
namespace {

using test::GcodeBead;
using test::number;

class Samples : public testing::Test {
 protected:
  struct Plan {
    nlohmann::json json;
    test::GcodeFile gcode;
  };
  /// A job without a summary does not analyse its pores, which takes most of the time.
  Plan plan(const std::string& job, const std::string& part, bool with_summary = true) {
    const std::string file = std::string(LAMINA_TEST_DIR) + "/../docs/examples/dinisio2022/" + job + ".toml";
    std::vector<std::string> words = {"extrude", part, "--job", file, "--overwrite", "--quiet", "-o", folder / "a.gcode"};
    if (with_summary) words.push_back("--json");
    const test::Outcome outcome = test::run_lamina(words, folder.path());
    EXPECT_EQ(outcome.code, 0) << job << ": " << outcome.err;
    Plan result{nlohmann::json::parse(outcome.out, nullptr, false), test::read_gcode(test::read_text(folder / "a.gcode"))};
    EXPECT_EQ(result.gcode.error, "") << job;
    return result;
  }
  std::string block(float x, float y, float z) {
    test::write_box(folder / "block.stl", {0, 0, 0}, {x, y, z});
    return folder / "block.stl";
  }
  std::string cylinder(double diameter, double height) {
    test::write_cylinder(folder / "cylinder.stl", diameter, height);
    return folder / "cylinder.stl";
  }
  test::Directory folder;
};

double length(const GcodeBead& b) { return std::hypot(b.x1 - b.x0, b.y1 - b.y0); }

/// Filling lines of a layer along one axis, each as the beads without a gap on one straight line.
std::vector<std::vector<GcodeBead>> lines_of(const test::GcodeLayer& layer, bool along_y) {
  std::vector<std::vector<GcodeBead>> lines;
  for (const GcodeBead& b : layer.beads) {
    if (b.type == "External perimeter" || b.type == "Perimeter" || length(b) < 0.01) continue;
    const bool y = std::abs(b.x1 - b.x0) < 0.002, x = std::abs(b.y1 - b.y0) < 0.002;
    if (along_y ? !y : !x) continue;
    const bool goes_on = !lines.empty() && std::hypot(lines.back().back().x1 - b.x0, lines.back().back().y1 - b.y0) < 0.002;
    if (goes_on) {
      lines.back().push_back(b);
    } else {
      lines.push_back({b});
    }
  }
  return lines;
}

/// Every line with thin segments begins and ends with thick ones, and all such lines are deposited in the same direction.
void expect_thick_ends(const test::GcodeLayer& layer, double thin_feed, const std::string& name) {
  std::size_t segmented = 0;
  std::set<bool> paths;
  for (const auto& line : lines_of(layer, true)) {
    if (std::ranges::none_of(line, [&](const GcodeBead& b) { return b.feed == thin_feed; })) continue;
    ++segmented;
    EXPECT_NE(line.front().feed, thin_feed) << name;
    EXPECT_NE(line.back().feed, thin_feed) << name;
    paths.insert(line.back().y1 > line.front().y0);
  }
  EXPECT_GT(segmented, 0) << name;
  EXPECT_EQ(paths.size(), 1) << name;
}

/// Nothing is fitted: 100 % is 0.85 of the rectangle of bead and layer, as the document prints its flow.
void expect_porosity_of_table_17(const std::map<std::string, double>& planned) {
  int near = 0, count = 0;
  double squares = 0;
  for (const auto& row : test::table(17)) {
    const std::string name = row.at("configuration");
    ASSERT_EQ(planned.count(name), 1u) << name;
    const double error = 100 * planned.at(name) - number(row, "effective_porosity_percent");
    testing::Test::RecordProperty(name, std::to_string(error));
    near += std::abs(error) <= 2 ? 1 : 0;
    squares += error * error;
    ++count;
  }
  EXPECT_EQ(count, 7);
  EXPECT_GE(near, 6);
  EXPECT_LE(std::sqrt(squares / count), 1.4);
}

TEST_F(Samples, SpeedsOfTable3AndExtrusionsOfTable4GoFromLineToLine) {
  const auto speed = plan("speed", block(62, 50, 0.3f));
  const auto speeds = test::table(3), extrusions = test::table(4);
  EXPECT_EQ(speed.json["layers_planned"], 1);
  EXPECT_EQ(speed.json["segments"]["lines"], 12);
  std::vector<std::vector<GcodeBead>> segmented;
  for (const auto& line : lines_of(speed.gcode.layers[0], true)) {
    if (line.size() == 3) segmented.push_back(line);
  }
  ASSERT_EQ(segmented.size(), speeds.size());
  for (std::size_t i = 0; i < speeds.size(); ++i) {
    if (i > 0) {
      EXPECT_NEAR(segmented[i - 1][0].x0 - segmented[i][0].x0, 4.8, 0.002);
    }
    EXPECT_NEAR(segmented[i][1].feed, number(speeds[i], "thin_speed_mm_s") * 60, 0.51);
    EXPECT_EQ(segmented[i][0].feed, 900);
    EXPECT_EQ(segmented[i][2].feed, 900);
    EXPECT_NEAR(length(segmented[i][1]), 30, 0.002);
    EXPECT_NEAR(segmented[i][1].filament / 30, segmented[i][0].filament / length(segmented[i][0]), 1e-5);
  }
  const auto extrusion = plan("extrusion", block(48, 50, 0.3f));
  EXPECT_EQ(extrusion.json["segments"]["lines"], 9);
  segmented.clear();
  for (const auto& line : lines_of(extrusion.gcode.layers[0], true)) {
    if (line.size() == 3) segmented.push_back(line);
  }
  ASSERT_EQ(segmented.size(), extrusions.size());
  for (std::size_t i = 0; i < extrusions.size(); ++i) {
    const auto& line = segmented[i];
    for (const GcodeBead& b : line) EXPECT_EQ(b.feed, 900);
    EXPECT_NEAR(line[1].filament / length(line[1]) / (line[0].filament / length(line[0])),
                number(extrusions[i], "thin_extrusion_percent") / 100, 0.001);
  }
}

TEST_F(Samples, RepeatedIntervalsOfTables5To7HaveTheirSpeedsExtrusionsAndSpacings) {
  struct Kind {
    std::string job;
    int extrusion, thick_speed;
    double spacing;
    float height;
  };
  std::vector<Kind> kinds;
  for (const auto& row : test::table(7)) {
    const int extrusion = static_cast<int>(number(row, "extrusion_percent")),
              speed = static_cast<int>(number(row, "thick_speed_percent"));
    const std::string percent = std::to_string(extrusion);
    if (extrusion > 75)
      kinds.push_back({"A" + percent + "-first", extrusion, 100, 2.4, 0.3f});  // Table 5; A75 stayed as it was
    kinds.push_back({"A" + percent, extrusion, speed, 2.4, 0.3f});             // Table 6
    for (const float height : {0.3f, 1.5f, 3.0f})
      kinds.push_back({"B" + percent, extrusion, speed, number(row, "spacing_sc_mm"), height});
  }
  for (const Kind& kind : kinds) {
    const auto sample = plan(kind.job, block(50, 28, kind.height), false);
    ASSERT_EQ(sample.gcode.layers.size(), std::lround(kind.height / 0.3)) << kind.job;
    const auto& layer = sample.gcode.layers[0];
    expect_thick_ends(layer, 1800, kind.job);
    std::vector<double> positions;
    double reference = 0;
    for (const auto& line : lines_of(layer, true)) {
      if (length(line[0]) > 20) reference = line[0].filament / length(line[0]);
    }
    ASSERT_GT(reference, 0) << kind.job;
    for (const auto& line : lines_of(layer, true)) {
      positions.push_back(line[0].x0);
      if (line.size() < 3) continue;
      for (const GcodeBead& b : line) {
        EXPECT_TRUE(b.feed == 1800 || b.feed == kind.thick_speed * 9) << kind.job << ' ' << b.feed;
        if (length(b) > 1) {
          EXPECT_NEAR(b.filament / length(b) / reference, kind.extrusion / 100.0, 0.002) << kind.job;
        }
        if (b.feed == 1800) {
          EXPECT_NEAR(length(b), 1.5, 0.002);
        }
      }
    }
    std::ranges::sort(positions);
    for (std::size_t i = 1; i < positions.size(); ++i)
      EXPECT_NEAR(positions[i] - positions[i - 1], kind.spacing, 0.002) << kind.job;
  }
}

TEST_F(Samples, CylindersOfTable8Have85LayersAndTheirSpacings) {
  const std::string part = cylinder(25.4, 25.4);
  std::map<std::string, double> porosity;
  for (const auto& row : test::table(8)) {
    const std::string name = row.at("configuration");
    const auto sample = plan(name, part);
    porosity[name] = sample.json["porosity"]["by_extrusion"].get<double>();
    ASSERT_EQ(sample.gcode.layers.size(), 85) << name;
    EXPECT_NEAR(sample.gcode.layers.back().z, 25.5, 1e-9);
    for (const std::size_t n : {0, 42, 84}) expect_thick_ends(sample.gcode.layers[n], 1800, name);
    const auto lines = lines_of(sample.gcode.layers[40], true);
    const double sc = number(row, "spacing_sc_mm"), cc = row.at("spacing_cc_mm") == "-" ? sc : number(row, "spacing_cc_mm");
    const auto continuous = static_cast<std::size_t>(number(row, "continuous_lines"));
    std::vector<std::pair<double, bool>> positions;  // of lines, and whether they are segmented
    for (const auto& line : lines) {
      const bool thin = std::ranges::any_of(line, [](const GcodeBead& b) { return b.feed == 1800; });
      if (line.size() == 1 && length(line[0]) < 5) continue;  // near the sides: thick all along
      positions.emplace_back(line[0].x0, thin);
      for (const GcodeBead& b : line) {
        if (b.feed == 1800) {
          EXPECT_NEAR(length(b), number(row, "thin_length_mm"), 0.002) << name;
        }
        if (thin && b.feed != 1800) {
          EXPECT_EQ(b.feed, number(row, "thick_speed_percent") * 9) << name;
        }
      }
    }
    std::ranges::sort(positions);
    std::size_t segmented = 0, last = 0;
    for (std::size_t i = 0; i < positions.size(); ++i) {
      if (i > 0) {
        EXPECT_NEAR(positions[i].first - positions[i - 1].first, positions[i].second || positions[i - 1].second ? sc : cc,
                    0.002)
            << name;
      }
      if (!positions[i].second) continue;
      if (segmented++ > 0) {
        EXPECT_EQ(i - last, continuous + 1) << name;
      }
      last = i;
    }
    EXPECT_GT(segmented, 8) << name;
  }
  const auto raster = plan("Raster", part);
  EXPECT_EQ(raster.gcode.layers.size(), 85);
  porosity["Raster"] = raster.json["porosity"]["by_extrusion"].get<double>();
  expect_porosity_of_table_17(porosity);
}

TEST_F(Samples, TheTomographyCylinderHasThreeFillingsByHeightAndDenseLayersAt90DegreesBetween) {
  const auto sample = plan("tomography", cylinder(15, 8.7));
  ASSERT_EQ(sample.gcode.layers.size(), 29);
  const double spacings[] = {0.43, 0.40, 0.49}, thick_feeds[] = {675, 900, 450};
  for (std::size_t n = 0; n < 29; ++n) {
    const auto& layer = sample.gcode.layers[n];
    const auto along_y = lines_of(layer, true), along_x = lines_of(layer, false);
    const auto longest = [](const auto& lines) {
      double maximum = 0;
      for (const auto& line : lines)
        maximum = std::max(maximum, std::hypot(line.back().x1 - line[0].x0, line.back().y1 - line[0].y0));
      return maximum;
    };
    if (n % 10 == 9) {
      EXPECT_GT(longest(along_x), 13) << n;
      EXPECT_LT(longest(along_y), 2) << n;
      std::vector<double> positions;
      for (const auto& line : along_x) {
        EXPECT_EQ(line[0].feed, 900);
        if (length(line[0]) > 5) positions.push_back(line[0].y0);
      }
      std::ranges::sort(positions);
      for (std::size_t i = 1; i < positions.size(); ++i) EXPECT_NEAR(positions[i] - positions[i - 1], 0.4, 0.002);
      continue;
    }
    EXPECT_GT(longest(along_y), 13) << n;
    expect_thick_ends(layer, 1800, "tomography");
    std::vector<double> positions;
    std::set<double> feeds;
    for (const auto& line : along_y) {
      if (line.size() > 1 || length(line[0]) > 5) positions.push_back(line[0].x0);
      for (const GcodeBead& b : line) feeds.insert(b.feed);
    }
    std::ranges::sort(positions);
    for (std::size_t i = 1; i < positions.size(); ++i)
      EXPECT_NEAR(positions[i] - positions[i - 1], spacings[n / 10], 0.002) << n;
    EXPECT_EQ(feeds, (std::set<double>{thick_feeds[n / 10], 900, 1800})) << n;
  }
}

/// The thin stretches of the first layer, along x or y, that meet one of the second, which is turned.
void expect_crossed_as_reported(const test::GcodeFile& gcode, const nlohmann::json& reported) {
  const auto is_thin = [](const GcodeBead& b) { return b.feed == 1800 && b.type == "Internal infill"; };
  const auto between = [](double a, double at, double b) { return std::min(a, b) <= at && at <= std::max(a, b); };
  int thin = 0, meet = 0;
  for (const GcodeBead& a : gcode.layers[0].beads) {
    if (!is_thin(a)) continue;
    ++thin;
    meet += std::ranges::any_of(gcode.layers[1].beads, [&](const GcodeBead& b) {
      if (!is_thin(b)) return false;
      const bool along_x = std::abs(a.y1 - a.y0) < 1e-9;
      return along_x ? between(a.x0, b.x0, a.x1) && between(b.y0, a.y0, b.y1)
                     : between(a.y0, b.y0, a.y1) && between(b.x0, a.x0, b.x1);
    });
  }
  EXPECT_EQ(reported["crossing"], thin);
  EXPECT_EQ(reported["crossed"], meet);
  // One in (thick + thin) / distance of segmented lines meets one, and the outermost have fewer to meet.
  EXPECT_GT(meet, thin / 5);
  EXPECT_LT(meet, thin * 2 / 5);
}

TEST_F(Samples, PoresOfLayersTurnedBy90DegreesLieOverEachOther) {
  const auto outcome = test::run_lamina({"extrude",      block(21, 17, 0.6f),
                                         "--machine",    "anet-a8",
                                         "--layer",      "0.3",
                                         "--fill",       "segmented",
                                         "--angle",      "90",
                                         "--angle-step", "90",
                                         "--spacing-sc", "0.5",
                                         "--thin",       "1.5",
                                         "--thick",      "1.5",
                                         "--set",        "segment.across=true",
                                         "--json",       "--quiet",
                                         "-o",           folder / "a.gcode"},
                                        folder.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto gcode = test::read_gcode(test::read_text(folder / "a.gcode"));
  ASSERT_EQ(gcode.error, "");
  expect_crossed_as_reported(gcode, nlohmann::json::parse(outcome.out, nullptr, false)["pores"][0]);
  // Middles of thin stretches lie on the segmented lines of the other layer, which are 1 mm apart.
  const auto thin_of = [&](std::size_t layer) {
    std::vector<std::array<double, 2>> middles;
    for (const GcodeBead& b : gcode.layers[layer].beads) {
      if (b.feed == 1800 && b.type == "Internal infill") middles.push_back({(b.x0 + b.x1) / 2, (b.y0 + b.y1) / 2});
    }
    return middles;
  };
  const auto first = thin_of(0), second = thin_of(1);
  ASSERT_GT(first.size(), 30);
  ASSERT_GT(second.size(), 30);
  const auto off_line = [](double a, double b) { return std::abs(std::remainder(a - b, 1.0)); };
  for (const auto& pore : first) EXPECT_LT(off_line(pore[1], second[0][1]), 0.003);
  for (const auto& pore : second) EXPECT_LT(off_line(pore[0], first[0][0]), 0.003);
}

}  // namespace
}  // namespace lamina
