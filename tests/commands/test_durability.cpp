// tests/commands/test_durability.cpp: what is synced, and before what it gets its name; and a disk that fails.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

class Durability : public ::testing::Test {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "the log of calls cannot be loaded before a sanitizer";
#endif
    write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    ::setenv("LD_PRELOAD", (fs::path(LAMINA_PROGRAM).parent_path() / "call_log.so").c_str(), 1);
    ::setenv("LAMINA_CALL_LOG", (log_ / "calls").c_str(), 1);
  }
  void TearDown() override {
    for (const char* name : {"LD_PRELOAD", "LAMINA_CALL_LOG", "LAMINA_FAIL_SYNC", "LAMINA_SYNC_ERRNO"}) ::unsetenv(name);
  }

  Outcome run(const std::string& line) {
    fs::remove(log_ / "calls");
    return run_lamina(words_of(line), directory_.path());
  }
  /// The calls of a run that ends well, one a line; paths below the directory, temporary names as NAME.~.
  std::vector<std::string> calls(const std::string& line) {
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << line << outcome.err;
    std::istringstream text(read_text(log_ / "calls"));
    std::vector<std::string> lines;
    for (std::string one; std::getline(text, one);) {
      const std::string base = directory_.path().string();
      for (std::size_t at = 0; (at = one.find(base)) != std::string::npos;) {
        const bool below = one.substr(at + base.size()).starts_with('/');
        one.replace(at, base.size() + (below ? 1 : 0), below ? "" : ".");
      }
      for (std::size_t at = 0; (at = one.find(".lamina-")) != std::string::npos;) one.replace(at, 8 + 13 + 5, ".~");
      lines.push_back(one);
    }
    return lines;
  }
  static std::size_t count(const std::vector<std::string>& lines, std::string_view begin) {
    return static_cast<std::size_t>(
        std::ranges::count_if(lines, [&](const std::string& line) { return line.starts_with(begin); }));
  }

  Directory directory_, log_;
};

using Lines = std::vector<std::string>;

TEST_F(Durability, AFileIsSyncedBeforeItGetsItsNameAndItsFolderBehind) {
  EXPECT_EQ(calls("heights part.stl --layer 1 --quiet -o table"), (Lines{"fsync table.~", "rename table.~ table", "fsync ."}));
  EXPECT_EQ(calls("extrude part.stl --machine anet-a8 --layer 0.3 --quiet -o x.gcode"),
            (Lines{"fsync x.gcode.json.~", "rename x.gcode.json.~ x.gcode.json.part", "fsync x.gcode.part",
                   "rename x.gcode.part x.gcode", "fsync .", "fsync x.gcode.json.part", "rename x.gcode.json.part x.gcode.json",
                   "fsync ."}));
}

TEST_F(Durability, LayersAreSyncedInOneGoBeforeTheManifestGetsItsName) {
  Lines lines = calls("jet part.stl --layer 0.1 --dpi 60 --quiet -o out");
  ASSERT_GT(lines.size(), 30u);
  EXPECT_EQ(count(lines, "rename layers/"), 0u);
  EXPECT_EQ(count(lines, "rename out/layers/"), 30u);
  EXPECT_EQ(count(lines, "fsync out/layers"), 0u);
  EXPECT_EQ(Lines(lines.end() - 4, lines.end()), (Lines{"syncfs out/layers", "fsync out/manifest.json.part",
                                                        "rename out/manifest.json.part out/manifest.json", "fsync out"}));
  lines = calls("slice part.stl --layer 0.1 --file-a-layer --quiet -o cut");
  EXPECT_EQ(Lines(lines.end() - 4, lines.end()), (Lines{"syncfs cut/layers", "fsync cut/manifest.json.part",
                                                        "rename cut/manifest.json.part cut/manifest.json", "fsync cut"}));
  EXPECT_EQ(count(calls("jet part.stl --shard 1/1 --layer 0.1 --dpi 60 --quiet -o share --sync off"), "syncfs"), 0u);
  lines = calls("merge share --quiet -o whole");
  EXPECT_EQ(Lines(lines.end() - 4, lines.end()), (Lines{"syncfs whole/layers", "fsync whole/manifest.json.part",
                                                        "rename whole/manifest.json.part whole/manifest.json", "fsync whole"}));
}

TEST_F(Durability, WithLayerEachFileIsSyncedBeforeItsNameAndTheNamesBeforeTheirRecord) {
  const Lines lines = calls("jet part.stl --layer 0.1 --dpi 60 --quiet -o out --sync layer");
  EXPECT_EQ(count(lines, "fsync out/layers/"), 30u);
  const auto at = [&](const std::string& line) { return std::ranges::find(lines, line) - lines.begin(); };
  for (const std::string name : {"out/layers/000000.tif", "out/layers/000029.tif"}) {
    EXPECT_LT(at("fsync " + name + ".~"), at("rename " + name + ".~ " + name));
  }
  EXPECT_LT(at("rename out/layers/000000.tif.~ out/layers/000000.tif"), at("fsync out/layers"));
  EXPECT_LT(at("fsync out/layers"), at("fsync out/manifest.json.part"));
  EXPECT_GE(
      count(calls("extrude part.stl --machine anet-a8 --layer 0.1 --quiet -o x.gcode --sync layer"), "fsync x.gcode.part"), 2u);
}

TEST_F(Durability, TheDiskBeginsWithALargeFileWhileItGrows) {
  const std::string line = "slice part.stl --layer 0.0003 --quiet -o ";  // 10,000 layers of some 250 bytes
  const Lines lines = calls(line + "out");
  const auto begins = std::ranges::find(lines, "begin out/part.svg.part");
  EXPECT_LT(begins, std::ranges::find(lines, "fsync out/part.svg.part"));
  EXPECT_EQ(count(calls(line + "off --sync off"), "begin"), 0u);
}

TEST_F(Durability, ABatchSyncsTheFilesOfItsJobsTogetherBeforeItRecordsThem) {
  write_text(directory_ / "list.txt", "jet part.stl --layer 0.5 --dpi 60 -o a\njet part.stl --layer 1 --dpi 60 -o b\n");
  const Lines lines = calls("batch list.txt --quiet -o out");
  const auto named = std::find(lines.rbegin(), lines.rend(), "rename out/b/manifest.json.part out/b/manifest.json");
  const auto synced = std::find(lines.rbegin(), lines.rend(), "syncfs out");
  ASSERT_NE(named, lines.rend());
  EXPECT_LT(synced - lines.rbegin(), named - lines.rbegin());
  EXPECT_EQ(count(lines, "fsync out/a") + count(lines, "syncfs out/a"), 0u);
  ::setenv("LAMINA_FAIL_SYNC", "failing", 1);
  EXPECT_EQ(run("batch list.txt --quiet -o failing").code, 4);
  const std::string record = read_text(directory_ / "failing/batch.jsonl");
  EXPECT_NE(record.find("failed"), std::string::npos);
  EXPECT_EQ(record.find("\"done\""), std::string::npos);
  // A job that says itself when it syncs is left alone.
  ::unsetenv("LAMINA_FAIL_SYNC");
  write_text(directory_ / "list.txt", "jet part.stl --layer 0.5 --dpi 60 -o a --sync job\n");
  EXPECT_GE(count(calls("batch list.txt --quiet -o own"), "syncfs own/a/layers"), 1u);
  EXPECT_GE(count(calls("batch list.txt --quiet -o off --sync off"), "syncfs off/a"), 1u);
}

TEST_F(Durability, OffSyncsNothingAndGivesTheSameBytes) {
  for (const std::string line :
       {"jet part.stl --layer 0.5 --machine hp45 --quiet -o ", "slice part.stl --layer 0.5 --quiet -o ",
        "slice part.stl --layer 0.5 --format 3mf --quiet -o ", "slice part.stl --layer 0.5 --file-a-layer --quiet -o "}) {
    const Lines lines = calls(line + "off --sync off");
    EXPECT_EQ(count(lines, "fsync") + count(lines, "syncfs") + count(lines, "fdatasync"), 0u) << line;
    for (const std::string sync : {"job", "layer"}) {
      EXPECT_EQ(run(line + sync + " --sync " + sync).code, 0);
      EXPECT_TRUE(tree_text(directory_ / "off") == tree_text(directory_ / sync)) << line << sync;
      fs::remove_all(directory_ / sync);
    }
    fs::remove_all(directory_ / "off");
  }
  EXPECT_EQ(calls("extrude part.stl --machine anet-a8 --layer 0.3 --quiet -o /dev/null"), Lines()) << "streams are not synced";
}

TEST_F(Durability, AnInterruptedJobGoesOnWithAnotherSync) {
  EXPECT_EQ(run("jet part.stl --layer 0.5 --dpi 60 --quiet -o out --sync off").code, 0);
  fs::rename(directory_ / "out/manifest.json", directory_ / "out/manifest.json.part");
  const Outcome outcome = run("jet part.stl --layer 0.5 --dpi 60 -o out --resume --sync layer");
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("0 planned, 6 kept"), std::string::npos) << outcome.err;
}

TEST_F(Durability, ADiskThatFailsIsExitCode4AndAFileSystemThatCannotSyncIsNone) {
  const struct {
    const char *line, *fails, *absent;
  } rows[] = {{"jet part.stl --layer 1 --dpi 60 --quiet -o out", "out/layers", "out/manifest.json"},
              {"jet part.stl --layer 1 --dpi 60 --quiet -o out --sync layer", "000001.tif", "out/manifest.json"},
              {"jet part.stl --layer 1 --dpi 60 --quiet -o out", "manifest.json.part", "out/manifest.json"},
              {"slice part.stl --layer 1 --quiet -o out", "part.svg.part", "out/part.svg"},
              {"slice part.stl --layer 1 --file-a-layer --quiet -o out", "layers", "out/manifest.json"},
              {"extrude part.stl --machine anet-a8 --layer 0.3 --quiet -o x.gcode", "x.gcode.part", "x.gcode"},
              {"heights part.stl --layer 1 --quiet -o table", "table.lamina-", "table"},
              {"machines --target target.stl", "target.stl", "target.stl"}};
  for (const auto& row : rows) {
    ::setenv("LAMINA_FAIL_SYNC", row.fails, 1);
    const Outcome outcome = run(row.line);
    EXPECT_EQ(outcome.code, 4) << row.line << outcome.err;
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find("Input/output error"), std::string::npos) << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / row.absent)) << row.line;
    fs::remove_all(directory_ / "out");
    for (const char* name : {"x.gcode.part", "x.gcode.json.part"}) fs::remove(directory_ / name);
    ::setenv("LAMINA_SYNC_ERRNO", std::to_string(EINVAL).c_str(), 1);
    EXPECT_EQ(run(row.line).code, 0) << row.line;
    ::unsetenv("LAMINA_SYNC_ERRNO");
    fs::remove_all(directory_ / "out");
  }
}

TEST_F(Durability, ADiskThatFailsEndsALongJobAtOnce) {
  ::setenv("LAMINA_FAIL_SYNC", "out/layers", 1);
  // 150 layers of 0.5 MB, none of which would be on the disk.
  const Outcome outcome = run("jet part.stl --layer 0.02 --dpi 120 --format pbm --threads 1 --quiet -o out");
  EXPECT_EQ(outcome.code, 4) << outcome.err;
  EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
  EXPECT_NE(outcome.err.find("Input/output error"), std::string::npos) << outcome.err;
  EXPECT_LT(files_below(directory_ / "out/layers").size(), 150u);
}

}  // namespace
}  // namespace lamina::test
