// tests/pipeline/run/test_slice_contours.cpp: what the files of lamina slice hold: areas, places, holes, offsets, gaps.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

// The hosts' readers are those of tests/formats/test_slice_hosts.cpp; here the areas are compared.
TEST(SliceContours, PolygonsAndShortCommandsHoldTheAreasOfTheOthers) {
  const Directory directory;
  std::map<std::string, std::string> files;
  for (const std::string format : {"cli", "svg-polygon", "cli-16"}) {
    const Outcome outcome = run_lamina({"slice", corpus_file("parameter_quality_nut.stl"), "--layer", "2", "--format", format,
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
      run_lamina({"slice", corpus_file("parameter_quality_nut.stl"), "--format", "svg-polygon", "--walls", "1", "-o", "filled"},
                 directory.path());
  EXPECT_EQ(filled.code, 2);
  EXPECT_NE(filled.err.find("--format svg-polygon: contains contours only"), std::string::npos) << filled.err;
}

TEST(SliceContours, ManifestSaysWhereEveryLayerLiesInTheFile) {
  const Directory directory;
  const Outcome outcome = run_lamina(
      {"slice", corpus_file("parameter_quality_nut.stl"), "--layer", "0.5", "-o", "out", "--json"}, directory.path());
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

TEST(SliceContours, SvgHasOnePathForEachOuterContourWithItsHoles) {
  const Directory directory;
  const Outcome outcome = run_lamina({"slice", corpus_file("nist_am_test_artifact_v3b.stl"), corpus_file("quad_knot.obj"),
                                      "--layer", "0.7", "-o", "out", "--quiet"},
                                     directory.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto manifest = nlohmann::json::parse(read_text(directory.path() / "out/manifest.json"));
  const std::string svg = read_text(directory.path() / "out" / manifest["file"].get<std::string>());
  std::size_t holes = 0, max_paths = 0;
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
    max_paths = std::max(max_paths, paths);
    EXPECT_NEAR(area, layer["area_mm2"].get<double>(), 1e-4);
  }
  EXPECT_GT(holes, 50u);
  EXPECT_GT(max_paths, 5u);
}

TEST(SliceContours, AnOffsetThatLeavesNothingIsSaid) {
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
TEST(SliceContours, PartsThatMeetOnlyAfterTheOffsetAreMerged) {
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

TEST(SliceContours, ClosedGapsAreCountedWithTheLargest) {
  const Directory directory;
  const Outcome outcome = run_lamina({"slice", corpus_file("broken/cube_missing_corner.stl"), "--no-repair", "--bridge", "50",
                                      "--layer", "5", "-o", "out", "--json"},
                                     directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(summary["gaps_closed"], 5);
  EXPECT_NEAR(summary["largest_gap_mm"].get<double>(), 36.203204, 1e-6);
  EXPECT_NE(outcome.err.find("gaps      5 closed by straight segments, the longest 36.203204 mm; 0 chains left open"),
            std::string::npos)
      << outcome.err;
}

TEST(SliceContours, OpenMeshesAreReportedWithTheirFirstPosition) {
  const Directory directory;
  const Outcome outcome = run_lamina(
      {"slice", corpus_file("broken/cube_missing_corner.stl"), "--no-repair", "--bridge", "0", "--layer", "5", "-o", "out"},
      directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("chains of cuts stay open, first in layer"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace lamina::test
