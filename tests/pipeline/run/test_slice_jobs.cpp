// tests/pipeline/run/test_slice_jobs.cpp: lamina slice as a program: same bytes, right and wrong use, what is left behind.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <tuple>

#include "pipeline/job/keys.h"
#include "pipeline/plan/fill.h"
#include "stages/data/text/toml.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

std::string corpus(const char* name) { return (fs::path(LAMINA_TEST_DIR) / "corpus" / name).string(); }

TEST(SliceProgram, SameBytesForAnyThreadsAndMemoryInEveryFormat) {
  const Directory directory;
  const std::vector<std::vector<std::string>> jobs = {
      {"--format", "svg", "--pattern", "raster", "--walls", "1", "--gap-formula", "0.1 + 0.01 * i"},
      {"--format", "svg", "--file-a-layer", "--pattern", "honeycomb"},
      {"--format", "cli", "--pattern", "contour+raster", "--stagger", "0,0.1"},
      {"--format", "cli-binary", "--empty-first-layer"},
      {"--format", "3mf"}};
  for (std::size_t j = 0; j < jobs.size(); ++j) {
    std::string first;
    for (const auto& [threads, memory] : {std::pair{"1", "1G"}, {"2", "1G"}, {"5", "1M"}}) {
      const std::string out = "out" + std::to_string(j) + threads;
      std::vector<std::string> arguments = {"slice",
                                            corpus("nist_am_test_artifact_v3b.stl"),
                                            corpus("dental_crown.stl"),
                                            "--layer",
                                            "2.3",
                                            "--quiet",
                                            "-o",
                                            out,
                                            "--threads",
                                            threads,
                                            "--memory",
                                            memory};
      arguments.insert(arguments.end(), jobs[j].begin(), jobs[j].end());
      const Outcome outcome = run_lamina(arguments, directory.path());
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      const std::string tree = tree_text(directory.path() / out);
      ASSERT_GT(tree.size(), 1000u);
      if (first.empty()) first = tree;
      EXPECT_EQ(tree, first) << jobs[j][1] << " with " << threads << " threads";
    }
  }
}

TEST(SliceProgram, SameBytesForEveryPatternFormatThreadsAndMemory) {
  const Directory directory;
  write_box(directory / "near.stl", {0, 0, 0}, {9, 8, 2});
  const std::vector<std::vector<std::string>> formats = {{"svg"}, {"svg", "--file-a-layer"}, {"cli"}, {"cli-binary"}, {"3mf"}};
  int number = 0;
  for (const char* pattern : {"none", "raster", "contour", "contour+raster", "honeycomb", "quatrefoil"}) {
    for (const auto& format : formats) {
      std::string first;
      for (const auto& [threads, memory] : {std::pair{"1", "1G"}, {"2", "1M"}, {"8", "16M"}}) {
        const std::string out = "o" + std::to_string(number++);
        std::vector<std::string> arguments = {"slice",      corpus("parameter_quality_nut.stl"),
                                              "near.stl",   "--layer",
                                              "1.9",        "--quiet",
                                              "-o",         out,
                                              "--walls",    "1",
                                              "--bead-gap", "0.3,0.1",
                                              "--pattern",  pattern,
                                              "--threads",  threads,
                                              "--memory",   memory,
                                              "--format"};
        arguments.insert(arguments.end(), format.begin(), format.end());
        if (std::string_view(pattern) != "contour") {  // whose curves have no direction
          arguments.insert(arguments.end(), {"--angle-step", "37", "--stagger", "0,0.1"});
        }
        const Outcome outcome = run_lamina(arguments, directory.path());
        ASSERT_EQ(outcome.code, 0) << pattern << ", " << format[0] << ": " << outcome.err;
        const std::string tree = tree_text(directory.path() / out);
        if (first.empty()) first = tree;
        EXPECT_EQ(tree, first) << pattern << ", " << format[0] << " with " << threads << " threads";
      }
    }
  }
}

// The hosts' readers are those of tests/write/test_slice_hosts.cpp; here the areas are compared.
TEST(SliceProgram, PolygonsAndShortCommandsHoldTheAreasOfTheOthers) {
  const Directory directory;
  std::map<std::string, std::string> files;
  for (const std::string format : {"cli", "svg-polygon", "cli-16"}) {
    const Outcome outcome = run_lamina({"slice", corpus("parameter_quality_nut.stl"), "--layer", "2", "--format", format,
                                        "--quiet", "-o", format, "--bed", "60x60"},
                                       directory.path());
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(run_lamina({"verify", format}, directory.path()).code, 0);
    files[format] = read_text(directory / (format + "/parameter_quality_nut" + (format[0] == 's' ? ".svg" : ".cli")));
  }
  const auto area = [](const std::vector<double>& xy) {
    double doubled = 0;
    for (std::size_t i = 0, j = xy.size() - 2; i < xy.size(); j = i, i += 2) doubled += xy[j] * xy[i + 1] - xy[i] * xy[j + 1];
    return doubled / 2;
  };
  const auto numbers = [](std::string text) {
    std::ranges::replace(text, ',', ' ');
    std::istringstream stream(text);
    std::vector<double> found;
    for (double value; stream >> value;) found.push_back(value);
    return found;
  };
  double text = 0, polygons = 0, shorts = 0, perimeter = 0;
  std::istringstream cli(files["cli"]), svg(files["svg-polygon"]);
  for (std::string line; std::getline(cli, line);) {
    if (!line.starts_with("$$POLYLINE/")) continue;
    std::vector<double> xy = numbers(line.substr(11));
    xy.erase(xy.begin(), xy.begin() + 3);
    text += area(xy);
    for (std::size_t i = 2; i < xy.size(); i += 2) perimeter += std::hypot(xy[i] - xy[i - 2], xy[i + 1] - xy[i - 1]);
  }
  for (std::string line; std::getline(svg, line);) {
    const std::size_t points = line.find("points=\"");
    if (line.starts_with("    <polygon ") && points != std::string::npos)
      polygons += area(numbers(line.substr(points + 8, line.find('"', points + 8) - points - 8)));
  }
  const std::string& binary = files["cli-16"];
  const double unit = std::stod(binary.substr(binary.find("$$UNITS/") + 8));
  std::size_t at = binary.find("$$HEADEREND") + 11;
  const auto take = [&] {
    at += 2;
    return static_cast<std::uint8_t>(binary[at - 2]) | static_cast<std::uint8_t>(binary[at - 1]) << 8;
  };
  while (at < binary.size()) {
    if (take() == 128) {
      take();
      continue;
    }
    take(), take();
    std::vector<double> xy(2 * static_cast<std::size_t>(take()));
    for (double& value : xy) value = take() * unit;
    shorts += area(xy);
  }
  EXPECT_GT(text, 1000);
  EXPECT_NEAR(polygons, text, 1e-6 * text);
  EXPECT_NEAR(shorts, text, perimeter * unit / 2);
  const Outcome filled =
      run_lamina({"slice", corpus("parameter_quality_nut.stl"), "--format", "svg-polygon", "--walls", "1", "-o", "filled"},
                 directory.path());
  EXPECT_EQ(filled.code, 2);
  EXPECT_NE(filled.err.find("--format svg-polygon: holds contours only"), std::string::npos) << filled.err;
}

TEST(SliceProgram, ManifestSaysWhereEveryLayerLiesInTheFile) {
  const Directory directory;
  const Outcome outcome =
      run_lamina({"slice", corpus("parameter_quality_nut.stl"), "--layer", "0.5", "-o", "out", "--json"}, directory.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto manifest = nlohmann::json::parse(read_text(directory.path() / "out/manifest.json"));
  const std::string file = read_text(directory.path() / "out" / manifest["file"].get<std::string>());
  ASSERT_EQ(manifest["layers"].size(), 45u);
  double volume = 0;
  for (const auto& layer : manifest["layers"]) {
    const std::string piece = file.substr(layer["offset"].get<std::size_t>(), layer["bytes"].get<std::size_t>());
    EXPECT_TRUE(piece.starts_with("\t<g id=\"layer" + std::to_string(layer["index"].get<int>()) + "\""));
    EXPECT_TRUE(piece.ends_with("</g>\n"));
    volume += layer["area_mm2"].get<double>() * layer["thickness_nm"].get<double>() * 1e-6;
  }
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_NEAR(summary["volume_mm3"].get<double>(), volume, 1e-3);
  EXPECT_NEAR(volume, 4427.93, 100);
  EXPECT_EQ(files_below(directory.path() / "out"),
            (std::vector<std::string>{"job.toml", "manifest.json", "parameter_quality_nut.svg"}));
}

TEST(SliceProgram, AnEarlierJobIsNotReplacedUnasked) {
  const Directory directory;
  const std::vector<std::string> arguments = {"slice", corpus("parameter_quality_nut.stl"), "--layer", "2", "--quiet", "-o",
                                              "out"};
  ASSERT_EQ(run_lamina(arguments, directory.path()).code, 0);
  const std::string before = tree_text(directory.path() / "out");
  const Outcome again = run_lamina(arguments, directory.path());
  EXPECT_EQ(again.code, 2);
  EXPECT_NE(again.err.find("--overwrite"), std::string::npos);
  EXPECT_EQ(tree_text(directory.path() / "out"), before);
  std::vector<std::string> over = arguments;
  over.push_back("--overwrite");
  EXPECT_EQ(run_lamina(over, directory.path()).code, 0);
  EXPECT_EQ(tree_text(directory.path() / "out"), before);
  // Nothing of a job of another name stays beside the one that replaces it.
  over[1] = corpus("dental_crown.stl");
  EXPECT_EQ(run_lamina(over, directory.path()).code, 0);
  EXPECT_FALSE(std::filesystem::exists(directory / "out/parameter_quality_nut.svg"));
  EXPECT_TRUE(std::filesystem::exists(directory / "out/dental_crown.svg"));
}

TEST(SliceProgram, NothingThatSomebodyElseWroteIsReplaced) {
  const Directory directory;
  const auto slice = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"slice", "part.stl", "--layer", "1", "--quiet"});
    return run_lamina(more, directory.path());
  };
  test::write_box(directory / "part.stl", {0, 0, 0}, {20, 10, 5});
  write_text(directory / "job.toml", "# mine\n[[part]]\npath = 'part.stl'\n");
  const auto before = tree_text(directory.path());
  for (const std::vector<std::string>& more : {std::vector<std::string>{"-o", "."}, {"-o", ".", "--overwrite"}}) {
    const Outcome refused = slice(more);
    EXPECT_EQ(refused.code, 2);
    EXPECT_NE(refused.err.find("job.toml"), std::string::npos) << refused.err;
    EXPECT_EQ(tree_text(directory.path()), before);
  }
  std::filesystem::create_directories(directory / "out/layers");
  write_text(directory / "out/layers/000003.svg", "mine");
  EXPECT_EQ(slice({"-o", "out", "--file-a-layer"}).code, 2);
  EXPECT_EQ(slice({"-o", "out", "--file-a-layer", "--resume"}).code, 2);
  const std::vector<std::string> kept = {"0000000007.svg", "20240131.svg.svg", "000001-front.svg", "000002.svg.bak"};
  for (const std::string& name : kept) write_text(directory / ("out/layers/" + name), "mine");
  EXPECT_EQ(read_text(directory / "out/layers/000003.svg"), "mine");
  EXPECT_EQ(slice({"-o", "out", "--file-a-layer", "--overwrite"}).code, 0);
  EXPECT_EQ(slice({"-o", "out", "--format", "cli", "--overwrite"}).code, 0);
  for (const std::string& name : kept) EXPECT_TRUE(fs::remove(directory / ("out/layers/" + name))) << name;
  EXPECT_EQ(files_below(directory / "out"), (std::vector<std::string>{"job.toml", "manifest.json", "part.cli"}));
}

TEST(SliceProgram, WrongFillingsAreOneClearLineAndLeaveNothing) {
  const Directory directory;
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases = {
      {{"--pattern", "raster", "--bead-gap", "-0.4"}, "leaves 0 mm from line to line"},
      {{"--pattern", "raster", "--bead-gap", "-0.5"}, "leaves -0.1 mm"},
      {{"--pattern", "raster", "--line-distance", "0"}, "--line-distance: 0 is out of range"},
      {{"--pattern", "raster", "--line-distance", "-1"}, "--line-distance: -1 is out of range"},
      {{"--pattern", "raster", "--angle", "north"}, "--angle: 'north'"},
      {{"--pattern", "raster", "--angle", "nan"}, "--angle: 'nan'"},
      {{"--pattern", "rastr"}, "did you mean"},
      {{"--pattern", "raster", "--gap-formula", "0.1 + "}, "'0.1 + '"},
      {{"--pattern", "raster", "--gap-formula", "1 / (n - n)"}, "finite"},
      {{"--pattern", "raster", "--gap-formula", "0.1 + y"}, "variables are"},
      {{"--pattern", "raster", "--set", "fill.by_height=0:5 gap_mm=0; 4:6 gap_mm=1"}, "4:6 overlaps 0:5"},
      {{"--pattern", "raster", "--set", "fill.by_height=5:4 gap_mm=0"}, "5:4"},
      {{"--pattern", "raster", "--set", "fill.by_height=1:2 gapp_mm=0"}, "did you mean 'gap_mm'"},
      {{"--pattern", "raster", "--set", "fill.gap_by_height=3:0.1, 2:0.2"}, "heights have to increase"},
      {{"--pattern", "raster", "--set", "fill.range=[{from_mm=0, to_mm=5}, {from_mm=4, to_mm=6}]"}, "4:6 overlaps 0:5"},
      {{"--pattern", "raster", "--set", "fill.range=[{from_mm=1, to_mm=2, gapp_mm=0}]"}, "did you mean 'gap_mm'"},
      {{"--pattern", "raster", "--set", "part.fill={angle_deg='x'}"}, "angle_deg: 'x'"},
      {{"--pattern", "raster", "--bead-gap", "0.2", "--line-distance", "0.5"},
       "fill.distance_mm (--line-distance) and fill.gap_mm (--bead-gap) both"},
      {{"--pattern", "raster", "--bead-gap", "0.2", "--gap-formula", "z"}, "fill.gap_formula (--gap-formula) and fill.gap_mm"},
      {{"--pattern", "raster", "--line-distance", "0.5", "--set", "fill.gap_by_height=0:0.1"}, "and fill.gap_by_height both"},
      {{"--pattern", "raster", "--line-distance", "0.5", "--set", "fill.group=2"}, "groups are of beads with gaps"},
      {{"--pattern", "raster", "--set", "fill.by_height=1:2 gap_mm=0 distance_mm=1"}, "1:2: gap_mm and distance_mm both"},
      {{"--pattern", "raster", "--set", "part.fill=gap_formula=z gap_mm=0.1"}, "gap_mm and gap_formula both"},
      {{"--pattern", "raster", "--shard", "1/2"}, "--shard: shards are of images"},
      {{"--pattern", "raster", "--set", "run.shard=1/2"}, "run.shard: shards are of images"},
      {{"--pattern", "raster", "--set", "part.fill=angle_deg=x"}, "angle_deg: 'x'"},
      {{"--pattern", "quatrefoil"}, "kept apart"},
      {{"--pattern", "raster", "--bead", "0"}, "--bead: 0 is out of range"},
      {{"--format", "3mf", "--file-a-layer"}, "--file-a-layer"},
      {{"--format", "stl"}, "--format: 'stl'"}};
  for (const auto& [more, expected] : cases) {
    std::vector<std::string> arguments = {"slice", corpus("parameter_quality_nut.stl"), "--layer", "1", "--quiet", "-o", "out"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = run_lamina(arguments, directory.path());
    EXPECT_EQ(outcome.code, 2) << more.back() << ": " << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(expected), std::string::npos) << more.back() << ": " << outcome.err;
    EXPECT_TRUE(files_below(directory.path() / "out").empty()) << more.back();
  }
}

TEST(SliceProgram, AJobThatFailsLeavesTheEarlierOne) {
  const Directory directory;
  for (const bool alone : {false, true}) {
    const std::string out = alone ? "alone" : "one";
    std::vector<std::string> arguments = {
        "slice", corpus("parameter_quality_nut.stl"), "--layer", "1", "--quiet", "-o", out, "--pattern", "raster"};
    if (alone) arguments.push_back("--file-a-layer");
    ASSERT_EQ(run_lamina(arguments, directory.path()).code, 0);
    const std::string before = tree_text(directory.path() / out);
    // The formula fails in layer 12, when others are long written.
    arguments.insert(arguments.end(), {"--overwrite", "--gap-formula", "1 / (n - 13) ^ 2"});
    const Outcome outcome = run_lamina(arguments, directory.path());
    EXPECT_EQ(outcome.code, 2);
    EXPECT_NE(outcome.err.find("n = 13"), std::string::npos) << outcome.err;
    EXPECT_EQ(tree_text(directory.path() / out), before);
    EXPECT_EQ(run_lamina({"verify", out}, directory.path()).code, 0);
  }
}

TEST(SliceProgram, VerifyFindsWhatWasChangedMissingOrAdded) {
  const Directory directory;
  for (const auto& format : {std::vector<std::string>{"svg"}, {"svg", "--file-a-layer"}, {"cli"}, {"cli-binary"}, {"3mf"}}) {
    std::vector<std::string> arguments = {
        "slice",   corpus("parameter_quality_nut.stl"), "--layer", "2", "--quiet", "--overwrite", "-o", "out", "--walls", "1",
        "--format"};
    arguments.insert(arguments.end(), format.begin(), format.end());
    const auto slice = [&] {
      std::filesystem::remove_all(directory / "out");
      ASSERT_EQ(run_lamina(arguments, directory.path()).code, 0);
    };
    slice();
    const Outcome whole = run_lamina({"verify", "out"}, directory.path());
    EXPECT_EQ(whole.code, 0) << format[0] << ": " << whole.err;
    for (const std::string& name : files_below(directory.path() / "out")) {
      if (name == "manifest.json" || name == "job.toml") continue;
      const std::string path = directory / ("out/" + name), text = read_text(path);
      for (const std::size_t at : {std::size_t{5}, text.size() / 2, text.size() - 3}) {
        std::string changed = text;
        changed[at] ^= 1;
        write_text(path, changed);
        const Outcome outcome = run_lamina({"verify", "out"}, directory.path());
        EXPECT_EQ(outcome.code, 5) << format[0] << ", byte " << at;
        EXPECT_NE(outcome.err.find(name), std::string::npos) << outcome.err;
      }
      write_text(path, text.substr(0, text.size() - 1));
      EXPECT_EQ(run_lamina({"verify", "out"}, directory.path()).code, 5);
      fs::remove(path);
      EXPECT_NE(run_lamina({"verify", "out"}, directory.path()).err.find("is missing"), std::string::npos);
      write_text(path, text);
      if (name.starts_with("layers/")) break;
    }
    if (format.size() > 1) {
      write_text(directory / "out/layers/000077.svg", "stray");
      EXPECT_EQ(run_lamina({"verify", "out"}, directory.path()).code, 5);
    }
    write_text(directory / "out/manifest.json", read_text(directory / "out/manifest.json").substr(0, 900));
    EXPECT_EQ(run_lamina({"verify", "out"}, directory.path()).code, 5) << "a manifest that was cut off";
  }
}

/// Twice the area of x0 y0 x1 y1 ..., y upwards.
double doubled_area_of(const std::vector<double>& c) {
  double sum = 0;
  for (std::size_t i = 0; i < c.size(); i += 2) {
    const std::size_t j = (i + 2) % c.size();
    sum -= c[i] * c[j + 1] - c[j] * c[i + 1];
  }
  return sum;
}

bool is_inside(const std::vector<double>& contour, double x, double y) {
  bool inside = false;
  for (std::size_t i = 0, j = contour.size() - 2; i < contour.size(); j = i, i += 2) {
    if ((contour[i + 1] > y) == (contour[j + 1] > y)) continue;
    if (x < contour[i] + (contour[j] - contour[i]) * (y - contour[i + 1]) / (contour[j + 1] - contour[i + 1])) inside = !inside;
  }
  return inside;
}

TEST(SliceProgram, SvgHasOnePathForEachOuterContourWithItsHoles) {
  const Directory directory;
  const Outcome outcome = run_lamina(
      {"slice", corpus("nist_am_test_artifact_v3b.stl"), corpus("quad_knot.obj"), "--layer", "0.7", "-o", "out", "--quiet"},
      directory.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto manifest = nlohmann::json::parse(read_text(directory.path() / "out/manifest.json"));
  const std::string svg = read_text(directory.path() / "out" / manifest["file"].get<std::string>());
  std::size_t holes = 0, most_paths = 0;
  for (const auto& layer : manifest["layers"]) {
    const std::string text = svg.substr(layer["offset"].get<std::size_t>(), layer["bytes"].get<std::size_t>());
    double area = 0;
    std::size_t paths = 0;
    for (std::size_t at = text.find("<path d=\""); at != std::string::npos; at = text.find("<path d=\"", at + 1), ++paths) {
      std::istringstream words(text.substr(at + 9, text.find('"', at + 9) - at - 9));
      std::vector<std::vector<double>> contours;
      for (std::string word; words >> word;) {
        if (word == "M")
          contours.emplace_back();
        else if (word != "z")
          contours.back().push_back(std::stod(word));
      }
      double own = 0;
      for (std::size_t c = 0; c < contours.size(); ++c) {
        const double doubled = doubled_area_of(contours[c]);
        own += doubled / 2;
        ASSERT_EQ(doubled > 0, c == 0) << "one outer contour, and it is the first";
        if (c == 0) continue;
        ++holes;
        // The middle of an edge: corners may touch.
        const double x = (contours[c][0] + contours[c][2]) / 2, y = (contours[c][1] + contours[c][3]) / 2;
        EXPECT_TRUE(is_inside(contours[0], x, y)) << "layer " << layer["index"];
      }
      const std::size_t said = text.find("slic3r:area=\"", at) + 13;
      EXPECT_NEAR(std::stod(text.substr(said)), own, 1e-3);
      area += own;
    }
    most_paths = std::max(most_paths, paths);
    EXPECT_NEAR(area, layer["area_mm2"].get<double>(), 1e-4);
  }
  EXPECT_GT(holes, 50u);
  EXPECT_GT(most_paths, 5u);
}

TEST(SliceProgram, AnOffsetThatLeavesNothingIsSaid) {
  const Directory directory;
  write_box(directory / "post.stl", {0, 0, 0}, {20, 3, 5});
  const Outcome outcome = run_lamina(
      {"slice", "post.stl", "--layer", "1", "--offset", "-1.6", "--allow-empty", "-o", "out", "--json"}, directory.path());
  EXPECT_EQ(outcome.code, 0);
  EXPECT_NE(outcome.err.find("--offset -1.6 leaves nothing of 5 of 5 layers, first layer 0"), std::string::npos) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(outcome.out)["emptied_layers"], 5);
  EXPECT_EQ(
      run_lamina({"slice", "post.stl", "--layer", "1", "--offset", "-1.4", "-o", "thin"}, directory.path()).err.find("warning"),
      std::string::npos);
}

/// Parts that are further apart than twice the offset before it, and meet after it.
TEST(SliceProgram, PartsThatMeetOnlyAfterTheOffsetAreUnited) {
  const Directory directory;
  write_box(directory / "a.stl", {0, 0, 0}, {10, 10, 1});
  write_text(directory / "j.toml",
             "[[part]]\npath = 'a.stl'\nat_mm = [100, 100]\n[[part]]\npath = 'a.stl'\nat_mm = [110.3, 100]\n");
  const Outcome outcome =
      run_lamina({"slice", "--job", "j.toml", "--layer", "1", "--offset", "0.2", "-o", "out", "--json"}, directory.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["contours"], 1);
  EXPECT_NEAR(summary["volume_mm3"].get<double>(), 20.7 * 10.4, 1e-6);
}

TEST(SliceProgram, ClosedGapsAreCountedWithTheLargest) {
  const Directory directory;
  const Outcome outcome = run_lamina({"slice", corpus("broken/cube_missing_corner.stl"), "--no-repair", "--bridge", "50",
                                      "--layer", "5", "-o", "out", "--json"},
                                     directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["gaps_closed"], 5);
  EXPECT_NEAR(summary["largest_gap_mm"].get<double>(), 36.203204, 1e-6);
  EXPECT_NE(outcome.err.find("gaps      5 closed by straight stretches, the longest 36.203204 mm; 0 chains left open"),
            std::string::npos)
      << outcome.err;
}

TEST(SliceProgram, OpenMeshesAreReportedWithTheirFirstPlace) {
  const Directory directory;
  const Outcome outcome = run_lamina(
      {"slice", corpus("broken/cube_missing_corner.stl"), "--no-repair", "--bridge", "0", "--layer", "5", "-o", "out"},
      directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("chains of cuts stay open, first in layer"), std::string::npos) << outcome.err;
}

TEST(SliceProgram, PreviewsOfSeveralLayersAreASheetAndWhatIsForImagesIsOneLine) {
  const Directory directory;
  ASSERT_EQ(run_lamina({"slice", corpus("parameter_quality_nut.stl"), "--layer", "2", "--pattern", "raster", "--layers", "2:9",
                        "--quiet", "-o", "out"},
                       directory.path())
                .code,
            0);
  const auto preview = [&](const std::string& output, std::vector<std::string> more) {
    more.insert(more.begin(), {"preview", "out", "-o", output, "--width", "400"});
    return run_lamina(more, directory.path());
  };
  const Outcome every = preview("every.png", {"--every", "3"}), count = preview("count.png", {"--count", "3"}),
                one = preview("one.png", {"--layer", "2"});
  for (const Outcome* outcome : {&every, &count, &one}) ASSERT_EQ(outcome->code, 0) << outcome->err;
  EXPECT_NE(every.out.find("every.png: 3 of 12 layers"), std::string::npos) << every.out;
  const std::string pictures[] = {read_text(directory / "every.png"), read_text(directory / "count.png"),
                                  read_text(directory / "one.png")};
  for (const std::string& picture : pictures) EXPECT_EQ(picture.substr(0, 8), "\x89PNG\r\n\x1a\n");
  EXPECT_NE(pictures[0], pictures[1]) << "layers 2, 5, 8 and 3, 5, 7";
  EXPECT_NE(pictures[0], pictures[2]);
  const std::vector<std::tuple<std::string, std::vector<std::string>, std::string>> wrong = {
      {"x.svg", {"--every", "3"}, "an SVG shows one layer"},
      {"x.png", {"--every", "3", "--count", "2"}, "exclude each other"},
      {"x.png", {"--whole-bed"}, "--whole-bed: is for images"},
      {"x.png", {"--layer", "77"}, "the job has layers 0 to 11"}};
  for (const auto& [output, more, expected] : wrong) {
    const Outcome outcome = preview(output, more);
    EXPECT_EQ(outcome.code, 2) << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(expected), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(directory / output));
  }
}

pipeline::FillChanges changes_of(std::string_view table) {
  pipeline::FillChanges changes;
  Place at;
  EXPECT_EQ(pipeline::read_fill_changes(*read_toml_value(table), changes, at), "");
  return changes;
}

/// Nine porous layers, then a dense one at 90 degrees, three times: the tomography cylinder of Di Nisio 2022, 3.3.1.
TEST(FillPlan, HeightsAndPartsChangeTheFilling) {
  using namespace pipeline;
  FillRequest request;
  apply(changes_of("{ pattern = 'raster', gap_mm = 0.12, angle_deg = 0, angle_step_deg = 0 }"), request.all);
  const FillChanges dense_there = changes_of("{ gap_mm = 0, angle_deg = 90 }");
  request.ranges = {{2.7, 3, dense_there}, {5.7, 6, dense_there}};
  const auto plan = plan_filling(request, changes_of("{ walls = 2 }"));
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  for (int layer = 0; layer < 29; ++layer) {
    const auto& at = plan->at(layer * 300'000 + 150'000);
    const bool dense = layer == 9 || layer == 19;
    EXPECT_EQ(at.gaps[0], dense ? 0 : 120'000) << layer;
    EXPECT_EQ(at.angle_base, dense ? 90'000'000 : 0) << layer;
    EXPECT_EQ(at.walls, 2u);
  }
  EXPECT_TRUE(plan->fills());
}

TEST(FillPlan, TheOneWayToGiveDistancesTakesThePlaceOfTheOneThatHeld) {
  using namespace pipeline;
  FillRequest request;
  apply(changes_of("{ pattern = 'raster', distance_mm = [0.5, 0.7] }"), request.all);
  request.ranges = {{1, 2, changes_of("{ gap_mm = 0.1 }")},
                    {2, 3, changes_of("{ gap_formula = '0.2*z' }")},
                    {3, 4, changes_of("{ gap_by_height = [[0, 0.3]] }")},
                    {4, 5, changes_of("{ angle_deg = 0 }")}};
  const auto plan = plan_filling(request, {});
  ASSERT_TRUE(plan.ok()) << plan.error().message;
  EXPECT_EQ(plan->at(500'000).distances, (std::vector<Nm>{500'000, 700'000}));
  EXPECT_EQ(plan->at(4'500'000).distances, (std::vector<Nm>{500'000, 700'000}));
  for (const std::int64_t height : {1'500'000, 2'500'000, 3'500'000}) EXPECT_TRUE(plan->at(height).distances.empty()) << height;
  EXPECT_EQ(plan->at(1'500'000).gaps, std::vector<Nm>{100'000});
  EXPECT_EQ(plan->at(2'500'000).gap_expression, "0.2*z");
  EXPECT_EQ(plan->at(3'500'000).gap_table.size(), 1u);
  const auto own = plan_filling(request, changes_of("{ gap_formula = '0.1' }"));
  ASSERT_TRUE(own.ok()) << own.error().message;
  EXPECT_TRUE(own->at(500'000).distances.empty());
  EXPECT_EQ(own->at(500'000).gap_expression, "0.1");
}

}  // namespace
}  // namespace lamina::test
