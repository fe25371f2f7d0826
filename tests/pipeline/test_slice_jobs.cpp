// tests/pipeline/test_slice_jobs.cpp: lamina slice as a program: same bytes, right and wrong use, what is left behind.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "pipeline/fill_request.h"
#include "tests/pipeline/program.h"

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
      std::vector<std::string> arguments = {"slice", corpus("nist_am_test_artifact_v3b.stl"), corpus("dental_crown.stl"),
                                            "--layer", "2.3", "--quiet", "-o", out, "--threads", threads, "--memory", memory};
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

TEST(SliceProgram, ManifestSaysWhereEveryLayerLiesInTheFile) {
  const Directory directory;
  const Outcome outcome = run_lamina({"slice", corpus("parameter_quality_nut.stl"), "--layer", "0.5", "-o", "out", "--json"},
                                     directory.path());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const auto manifest = nlohmann::json::parse(read_text(directory.path() / "out/manifest.json"));
  const std::string file = read_text(directory.path() / "out" / manifest["file"].get<std::string>());
  ASSERT_EQ(manifest["layers"].size(), 45u);
  double volume = 0;
  for (const auto& layer : manifest["layers"]) {
    const std::string piece = file.substr(layer["offset"].get<std::size_t>(), layer["bytes"].get<std::size_t>());
    EXPECT_TRUE(piece.starts_with("\t<g id=\"layer" + std::to_string(layer["layer"].get<int>()) + "\""));
    EXPECT_TRUE(piece.ends_with("</g>\n"));
    volume += layer["area_mm2"].get<double>() * layer["thickness_nm"].get<double>() * 1e-6;
  }
  const auto summary = nlohmann::json::parse(outcome.out);
  EXPECT_NEAR(summary["volume_mm3"].get<double>(), volume, 1e-3);
  EXPECT_NEAR(volume, 4427.93, 100);
  EXPECT_EQ(files_below(directory.path() / "out"), (std::vector<std::string>{"job.toml", "manifest.json", "parameter_quality_nut.svg"}));
}

TEST(SliceProgram, AnEarlierJobIsNotReplacedUnasked) {
  const Directory directory;
  const std::vector<std::string> arguments = {"slice", corpus("parameter_quality_nut.stl"), "--layer", "2", "--quiet", "-o", "out"};
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
  EXPECT_EQ(read_text(directory / "out/layers/000003.svg"), "mine");
  EXPECT_EQ(slice({"-o", "out", "--file-a-layer", "--overwrite"}).code, 0);
  EXPECT_EQ(slice({"-o", "out", "--format", "cli", "--overwrite"}).code, 0);
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

TEST(SliceProgram, OpenMeshesAreReportedWithTheirFirstPlace) {
  const Directory directory;
  const Outcome outcome = run_lamina({"slice", corpus("broken/cube_missing_corner.stl"), "--no-repair", "--bridge", "0", "--layer",
                                      "5", "-o", "out"}, directory.path());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("chains of cuts stay open, first in layer"), std::string::npos) << outcome.err;
}

/// Nine porous layers, then a dense one at 90 degrees, three times: the tomography cylinder of Di Nisio 2022, 3.3.1.
TEST(FillPlan, HeightsAndPartsChangeTheFilling) {
  using namespace pipeline;
  FillRequest request;
  ASSERT_EQ(read_fill_changes("pattern=raster gap_mm=0.12 angle_deg=0 angle_step_deg=0", request.all), "");
  request.by_height = "2.7:3 gap_mm=0 angle_deg=90; 5.7:6 gap_mm=0 angle_deg=90";
  const auto plan = plan_filling(request, "walls=2");
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

}  // namespace
}  // namespace lamina::test
