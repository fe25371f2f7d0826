// tests/pipeline/run/test_slice_jobs.cpp: lamina slice as a program: same bytes, right and wrong use, what is left behind.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

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
                                            corpus_file("nist_am_test_artifact_v3b.stl"),
                                            corpus_file("dental_crown.stl"),
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
        std::vector<std::string> arguments = {"slice",      corpus_file("parameter_quality_nut.stl"),
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

TEST(SliceProgram, AnEarlierJobIsNotReplacedUnrequested) {
  const Directory directory;
  const std::vector<std::string> arguments = {
      "slice", corpus_file("parameter_quality_nut.stl"), "--layer", "2", "--quiet", "-o", "out"};
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
  // No file of a job of another name stays next to the one that replaces it.
  over[1] = corpus_file("dental_crown.stl");
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
      {{"--pattern", "raster", "--set", "fill.by_height=0:5 gap_mm=0; 4:6 gap_mm=1"}, "is now fill.range"},
      {{"--pattern", "raster", "--set", "fill.range=[{from_mm=5, to_mm=4, gap_mm=0}]"}, "5:4"},
      {{"--pattern", "raster", "--set", "fill.gap_by_height=[[3, 0.1], [2, 0.2]]"}, "heights have to increase"},
      {{"--pattern", "raster", "--set", "fill.range=[{from_mm=0, to_mm=5}, {from_mm=4, to_mm=6}]"}, "4:6 overlaps 0:5"},
      {{"--pattern", "raster", "--set", "fill.range=[{from_mm=1, to_mm=2, gapp_mm=0}]"}, "did you mean 'gap_mm'"},
      {{"--pattern", "raster", "--set", "part.fill={angle_deg='x'}"}, "angle_deg: 'x'"},
      {{"--pattern", "raster", "--bead-gap", "0.2", "--line-distance", "0.5"},
       "fill.distance_mm (--line-distance) and fill.gap_mm (--bead-gap) both"},
      {{"--pattern", "raster", "--bead-gap", "0.2", "--gap-formula", "z"}, "fill.gap_formula (--gap-formula) and fill.gap_mm"},
      {{"--pattern", "raster", "--line-distance", "0.5", "--set", "fill.gap_by_height=[[0, 0.1]]"},
       "and fill.gap_by_height both"},
      {{"--pattern", "raster", "--line-distance", "0.5", "--set", "fill.group=2"}, "groups are of beads with gaps"},
      {{"--pattern", "raster", "--set", "fill.range=[{from_mm=1, to_mm=2, gap_mm=0, distance_mm=1}]"},
       "1:2: gap_mm and distance_mm both"},
      {{"--pattern", "raster", "--set", "part.fill={gap_formula='z', gap_mm=0.1}"}, "gap_mm and gap_formula both"},
      {{"--pattern", "raster", "--shard", "1/2"}, "--shard: shards are of images"},
      {{"--pattern", "raster", "--set", "run.shard=1/2"}, "run.shard: shards are of images"},
      {{"--pattern", "quatrefoil"}, "kept apart"},
      {{"--pattern", "raster", "--bead", "0"}, "--bead: 0 is out of range"},
      {{"--format", "3mf", "--file-a-layer"}, "--file-a-layer"},
      {{"--format", "stl"}, "--format: unknown value 'stl'"}};
  for (const auto& [more, expected] : cases) {
    std::vector<std::string> arguments = {"slice", corpus_file("parameter_quality_nut.stl"), "--layer", "1", "--quiet", "-o",
                                          "out"};
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
        "slice", corpus_file("parameter_quality_nut.stl"), "--layer", "1", "--quiet", "-o", out, "--pattern", "raster"};
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
    std::vector<std::string> arguments = {"slice",   corpus_file("parameter_quality_nut.stl"),
                                          "--layer", "2",
                                          "--quiet", "--overwrite",
                                          "-o",      "out",
                                          "--walls", "1",
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

TEST(SliceProgram, PreviewsOfSeveralLayersAreASheetAndWhatIsForImagesIsOneLine) {
  const Directory directory;
  ASSERT_EQ(run_lamina({"slice", corpus_file("parameter_quality_nut.stl"), "--layer", "2", "--pattern", "raster", "--layers",
                        "2:9", "--quiet", "-o", "out"},
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

}  // namespace
}  // namespace lamina::test
