// lamina heights, and jobs whose layers fit the part.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

// A box with a ledge: 12 x 10 x 2.05 mm, and 6 x 10 x 1 mm on its left.
void write_ledge(const Directory& directory) {
  write_box(directory / "low.stl", {0, 0, 0}, {12, 10, 2.05f});
  write_box(directory / "high.stl", {0, 0, 0}, {6, 10, 3.05f});
}

TEST(HeightsCommand, ReportsTheTableInEveryForm) {
  const Directory directory;
  write_ledge(directory);
  const std::vector<std::string> call = {"heights", "low.stl", "--heights", "optimal", "--thickness", "0.1..0.3", "--quiet"};
  const auto run = [&](std::initializer_list<std::string> more) {
    std::vector<std::string> all = call;
    all.insert(all.end(), more);
    return run_lamina(all, directory.path());
  };
  const Outcome text = run({});
  EXPECT_EQ(text.code, 0) << text.err;
  EXPECT_NE(text.out.find("layers    7 of 0.1..0.3 mm, optimal"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("flats     1 of 1 hit"), std::string::npos) << text.out;
  EXPECT_NE(text.out.find("proof"), std::string::npos);
  EXPECT_TRUE(text.err.empty()) << text.err;
  const Outcome csv = run({"--format", "csv"});
  EXPECT_EQ(std::count(csv.out.begin(), csv.out.end(), '\n'), 8) << csv.out;
  const Outcome json = run({"--format", "json", "--compare"});
  const auto compared = nlohmann::json::parse(json.out);
  EXPECT_EQ(compared["tables"].size(), 6u);
  EXPECT_EQ(compared["tables"][3]["name"], "stepwise");
  EXPECT_EQ(std::count(json.out.begin(), json.out.end(), '\n'), 1) << "one line";
  const Outcome rp3 = run({"--format", "rp3", "-o", "table.rp3"});
  EXPECT_EQ(rp3.code, 0);
  EXPECT_TRUE(rp3.out.empty());
  EXPECT_TRUE(read_text(directory / "table.rp3").ends_with("----- fim do arquivo -----\n"));
  EXPECT_EQ(run({"--plot", "plot.svg"}).code, 0);
  EXPECT_TRUE(read_text(directory / "plot.svg").ends_with("</svg>\n"));
}

// The job of the document had the factors 1.007, 1.007 and 1, and lists the slopes of the STL file.
TEST(HeightsCommand, AppendixBIsPrintedWithItsShrinkFactors) {
  const std::string reference = std::string(LAMINA_TEST_DIR) + "/reference/lima2009/";
  const Directory directory;
  const Outcome outcome =
      run_lamina({"heights", reference + "case1_plane.stl", "--heights", "angle", "--thickness", "0.178,0.254", "--facets",
                  "plane", "--shrink", "1.007,1.007,1", "--format", "rp3", "--quiet"},
                 directory.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  std::istringstream file(outcome.out), published(read_text(reference + "appendix_b.rp3.tsv"));
  std::vector<std::string> rows;
  for (std::string row; std::getline(file, row);) {
    if (row.find("\t0.508\t") != std::string::npos) rows.push_back(row);
  }
  ASSERT_EQ(rows.size(), 59u) << "a row for the last layer comes first";
  std::size_t equal = 0, count = 0;
  for (std::string row; std::getline(published, row);) {
    if (row.find("\t0.508\t") == std::string::npos) continue;
    if (const std::size_t wall = row.find("-0.00"); wall != std::string::npos) row.erase(wall, 1);
    if (++count < rows.size()) equal += rows[count] == row ? 1 : 0;
  }
  EXPECT_EQ(count, 58u);
  EXPECT_EQ(equal, 58u) << outcome.out;
}

TEST(HeightsCommand, TheTopIsCoveredAndSmallPeaksAreReported) {
  const Directory directory;
  write_box(directory / "box.stl", {0, 0, 0}, {5, 5, 4.892f});  // 19 layers of 0.254 and 66 um
  const auto heights = [&](std::vector<std::string> more) {
    std::vector<std::string> call = {"heights",     "box.stl",  "--heights", "angle",  "--thickness",
                                     "0.178,0.254", "--format", "json",      "--quiet"};
    call.insert(call.end(), more.begin(), more.end());
    const Outcome outcome = run_lamina(call, directory.path());
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return nlohmann::json::parse(outcome.out)["tables"][0];
  };
  EXPECT_NEAR(heights({})["top_miss_mm"].get<double>(), -0.066, 1e-6);
  EXPECT_NEAR(heights({"--cover-top"})["top_miss_mm"].get<double>(), 0.036, 1e-6);
  EXPECT_EQ(heights({"--flat-area", "30"})["small_peaks"], 1) << "the top is smaller than that";
  EXPECT_FALSE(heights({"--flat-area", "30", "--peaks", "facets"}).contains("small_peaks"));
  const Outcome jet = run_lamina({"jet", "box.stl", "--bed", "10x10", "--dpi", "200", "--heights", "angle", "--thickness",
                                  "0.178,0.254", "--flat-area", "30", "--cover-top", "--title", "order 7", "-o", "out"},
                                 directory.path());
  EXPECT_EQ(jet.code, 0) << jet.err;
  EXPECT_NE((jet.out + jet.err).find("a height with horizontal facets below 30 mm2 in all is no peak; --peaks facets"),
            std::string::npos)
      << jet.out << jet.err;
  EXPECT_NE(read_text(directory / "out/layers/000019.tif").find("order 7, layer 20 of 20, z 4.75 to 4.928 mm"),
            std::string::npos);
  const auto layers = nlohmann::json::parse(read_text(directory / "out/manifest.json"))["layers"];
  ASSERT_EQ(layers.size(), 20u);
  EXPECT_EQ(layers[19]["set_pixels"], layers[0]["set_pixels"]) << "the last layer is printed";
  expect_refused("jet box.stl --cover-top -o no", 2, "--cover-top: applies to --heights angle and optimal", directory);
  expect_refused("jet box.stl --heights cusp --thickness 0.1,0.2 --cusp-of nominal -o no", 2, "add --shrink", directory);
  expect_refused("jet box.stl --heights optimal --thickness 0.1,0.2 --peaks facets -o no", 2,
                 "--peaks: applies to --heights angle", directory);
}

// Pictures are drawn by lamina-preview.
TEST(HeightsCommand, PreviewDrawsThePlotThatSvgHoldsAndLeavesNothingElse) {
  const Directory directory;
  write_ledge(directory);
  for (const std::string name : {"plot.svg", "plot.png"}) {
    const Outcome plot = run_lamina({"heights", "low.stl", "--layer", "0.2", "--plot", name, "--quiet"}, directory.path());
    ASSERT_EQ(plot.code, 0) << plot.err;
    EXPECT_TRUE(plot.out.starts_with("layers ")) << plot.out;
    EXPECT_TRUE(plot.err.empty()) << plot.err;
  }
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(directory.path()), {}), 4);
  const std::string svg = read_text(directory / "plot.svg"), png = read_text(directory / "plot.png");
  EXPECT_NE(svg.find("width=\"1200\" height=\"900\""), std::string::npos);
  EXPECT_NE(svg.find(">low.stl: 11 layers, uniform 0.2 mm</text>"), std::string::npos) << svg;
  EXPECT_EQ(png.substr(1, 3), "PNG");
  EXPECT_EQ(png.substr(16, 8), std::string("\0\0\x04\xb0\0\0\x03\x84", 8)) << "1200 x 900";
  std::filesystem::create_directory(directory / "taken.png");
  const Outcome taken =
      run_lamina({"heights", "low.stl", "--layer", "0.2", "--plot", "taken.png", "--quiet"}, directory.path());
  EXPECT_EQ(taken.code, 4) << taken.err;
  EXPECT_EQ(taken.error_lines(), 1u) << taken.err;
}

TEST(HeightsCommand, LayersOfOthersAreMeasuredByTheSameRules) {
  const Directory directory;
  write_ledge(directory);
  write_text(directory / "tops.txt", "# tops\n0.5\n1.0 \n\n2.0\n");
  const Outcome outcome = run_lamina(
      {"heights", "low.stl", "--measure", "tops.txt", "--layer", "0.5", "--format", "json", "--quiet"}, directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const auto table = nlohmann::json::parse(outcome.out)["tables"][0];
  EXPECT_EQ(table["layers"], 3) << outcome.out;
  EXPECT_EQ(table["top_mm"], 2) << outcome.out;
  EXPECT_EQ(table["top_miss_mm"], -0.05) << outcome.out;
  write_text(directory / "tops.txt", "0.5\n0.5\n");
  const Outcome wrong = run_lamina({"heights", "low.stl", "--measure", "tops.txt"}, directory.path());
  EXPECT_EQ(wrong.code, 3);
  EXPECT_NE(wrong.err.find("tops.txt:2: "), std::string::npos) << wrong.err;
}

// A box of 10 x 10 x 3 mm: 30 layers of 0.1 mm or 10 of 0.3 take 2 s each and 100 mm2 / (0.4 mm x 40 mm/s) = 6.25 s, 247.5
// and 82.5 s together: 66.7 % saved.
TEST(HeightsCommand, AComparisonReportsTimeAndWhatIsSavedNextToThinLayers) {
  const Directory directory;
  write_box(directory.path() / "box.stl", {0, 0, 0}, {10, 10, 3});
  const std::vector<std::string> call = {"heights", "box.stl", "--thickness", "0.1,0.3", "--compare", "--quiet"};
  const std::string text = run_lamina(call, directory.path()).out;
  EXPECT_NE(text.find("4 min 07 s    0.0 %\n"), std::string::npos) << text;
  EXPECT_NE(text.find("1 min 22 s   66.7 %\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\ntime: 2 s a layer and 0.0625 s a mm2 of its section, as beads"), std::string::npos) << text;
  auto more = call;
  more.insert(more.end(), {"--format", "json"});
  auto tables = nlohmann::json::parse(run_lamina(more, directory.path()).out)["tables"];
  EXPECT_NEAR(tables[0]["seconds"].get<double>(), 247.5, 1e-3);
  EXPECT_NEAR(tables[1]["seconds"].get<double>(), 82.5, 1e-3);
  more.insert(more.end(), {"--time-model", "12"});
  tables = nlohmann::json::parse(run_lamina(more, directory.path()).out)["tables"];
  EXPECT_NEAR(tables[0]["seconds"].get<double>(), 360, 1e-3);
}

TEST(HeightsCommand, WrongUseIsOneLineThatNamesTheOption) {
  const Directory directory;
  write_ledge(directory);
  const std::pair<std::vector<std::string>, const char*> calls[] = {
      {{"--heights", "cusp"}, "--thickness"},
      {{"--heights", "cups"}, "did you mean 'cusp'?"},
      {{"--cover-top"}, "--cover-top: applies to --heights angle and optimal"},
      {{"--heights", "cusp", "--thickness", "0.1,0.2", "--cover-top"}, "--cover-top: applies to --heights angle and optimal"},
      {{"--cusp-of", "nominal"}, "--cusp-of: applies to steps on parts that shrink"},
      {{"--heights", "optimal", "--thickness", ""}, "--thickness: contains no thickness"},
      {{"--heights", "optimal", "--thickness", "0.3..0.1"}, "--thickness: the least thickness"},
      {{"--heights", "optimal", "--thickness", "0.05..0.3:0.1"}, "end at 0.25 mm and miss 0.3 mm"},
      {{"--heights", "optimal", "--thickness", "-0.1,0.2"}, "--thickness: -0.1"},
      {{"--heights", "optimal", "--thickness", "0.1,0.2", "--cusp", "0"}, "--cusp: 0"},
      {{"--heights", "optimal", "--thickness", "0.1,0.2", "--time-model", "-1"}, "--time-model: -1"},
      {{"--thickness", "0.1,0.2"}, "uniform layers have one thickness"},
      {{"--format", "xml"}, "--format: unknown value 'xml'"},
      {{"--plot", "plot.gif"}, "--plot plot.gif"},
      {{"--thickness", "0.1..0.3", "--compare", "--format", "rp3"},
       "--format rp3: holds one table, and --compare makes several"},
      {{"high.stl", "--thickness", "0.1..0.3", "--per-part", "--format", "rp3"}, "--per-part makes several"},
      {{"high.stl", "--thickness", "0.178,0.254", "--per-part"}, "0.178 and 0.254 mm meet only every 22.606 mm"},
      {{"--heights", "optimal", "--thickness", "0.000002,0.000003", "--scale", "100"}, "heights.thickness"},
  };
  for (const auto& [options, reported] : calls) {
    std::vector<std::string> all = {"heights", "low.stl"};
    all.insert(all.end(), options.begin(), options.end());
    const Outcome outcome = run_lamina(all, directory.path());
    EXPECT_EQ(outcome.code, 2) << reported;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find(reported), std::string::npos) << outcome.err;
  }
  const Outcome plot = run_lamina({"heights", "low.stl", "--plot", "no/o.png"}, directory.path());
  EXPECT_EQ(plot.code, 4);
  EXPECT_TRUE(plot.out.empty()) << plot.out;
  EXPECT_NE(plot.err.find("--plot no/o.png: there is no folder no;"), std::string::npos) << plot.err;
  EXPECT_EQ(plot.error_lines(), 1u) << plot.err;
  const Outcome jet = run_lamina({"jet", "low.stl", "--per-part", "-o", "out"}, directory.path());
  EXPECT_EQ(jet.code, 2);
  EXPECT_NE(jet.err.find("--per-part"), std::string::npos) << jet.err;
}

TEST(JetHeights, LayersOfEveryWayAreVerifiedAndRecordedWithTheirReason) {
  const Directory directory;
  write_ledge(directory);
  for (const char* way : {"angle", "cusp", "stepwise", "optimal"}) {
    const Outcome jet = run_lamina({"jet", "low.stl", "high.stl", "--bed", "40x40", "--dpi", "200", "--heights", way,
                                    "--thickness", "0.1..0.3:0.01", "-o", way},
                                   directory.path());
    ASSERT_EQ(jet.code, 0) << jet.err;
    EXPECT_EQ(run_lamina({"verify", way}, directory.path()).code, 0) << way;
  }
  const std::string manifest = read_text(directory / "optimal/manifest.json");
  EXPECT_NE(manifest.find("\"reason\": \"flat\""), std::string::npos);
  EXPECT_NE(manifest.find("\"layer_count\": 11"), std::string::npos) << manifest;  // 7 to 2.05, 4 to 3.05
}

TEST(JetHeights, StepsInsideLieWithinThoseAcrossAndTheseWithinThoseOutside) {
  const Directory directory;
  // A wedge: two boxes cannot show it, a tetrahedron does.
  write_text(directory / "wedge.stl",
             "solid w\n"
             "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 20 0\nvertex 20 0 0\nendloop\nendfacet\n"
             "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 20 0 0\nvertex 0 0 10\nendloop\nendfacet\n"
             "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 0 0 10\nvertex 0 20 0\nendloop\nendfacet\n"
             "facet normal 0 0 0\nouter loop\nvertex 20 0 0\nvertex 0 20 0\nvertex 0 0 10\nendloop\nendfacet\n"
             "endsolid w\n");
  std::vector<long> pixels;
  for (const char* side : {"inside", "across", "outside"}) {
    const Outcome jet = run_lamina({"jet", "wedge.stl", "--bed", "30x30", "--dpi", "254", "--layer", "1", "--containment", side,
                                    "--engine", "both", "--json", "--quiet", "-o", side},
                                   directory.path());
    ASSERT_EQ(jet.code, 0) << jet.err;
    const std::size_t at = jet.out.find("\"set_pixels\":");
    ASSERT_NE(at, std::string::npos) << jet.out;
    pixels.push_back(std::stol(jet.out.substr(at + 13)));
  }
  // 200 x 200 / 2 pixels times (1 - z / 10) squared: at the tops, the middles, the bottoms of ten layers.
  EXPECT_NEAR(static_cast<double>(pixels[0]), 20'000 * 2.85, 20'000 * 0.03);
  EXPECT_NEAR(static_cast<double>(pixels[1]), 20'000 * 3.325, 20'000 * 0.03);
  EXPECT_NEAR(static_cast<double>(pixels[2]), 20'000 * 3.85, 20'000 * 0.03);
}

}  // namespace
}  // namespace lamina::test
