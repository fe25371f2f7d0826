// tests/commands/test_old_manifest.cpp: directories as older builds left them. tests/golden/old_manifest, of commit ef3e1c3:
// what reads them says in one line that another version wrote them, and changes nothing. tests/golden/kept_jobs, of commit
// 418be7f and this version, without the keys that came after it: they go on.
#include <gtest/gtest.h>

#include "stages/support/text/version.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

TEST(OldManifest, IsRefusedInOneLineAndLeftAsItIs) {
  const fs::path corpus = fs::path(LAMINA_TEST_DIR) / "corpus";
  const std::string nut = (corpus / "parameter_quality_nut.stl").string();
  const std::vector<std::vector<std::string>> uses = {
      {"verify", "jet"},
      {"verify", "slice"},
      {"preview", "jet", "-o", "sheet.png"},
      {"preview", "slice", "-o", "sheet.png"},
      {"report", "jet", "-o", "report.html"},
      {"merge", "jet", "-o", "merged"},
      {"jet", nut, "--bed", "14x24", "--dpi", "100", "--layer", "12", "--quiet", "-o", "jet", "--resume"},
  };
  for (const std::vector<std::string>& use : uses) {
    SCOPED_TRACE(testing::PrintToString(use));
    const Directory directory;
    fs::copy(fs::path(LAMINA_TEST_DIR) / "golden/old_manifest", directory.path(), fs::copy_options::recursive);
    const std::string jet = tree_text(directory.path() / "jet"), slice = tree_text(directory.path() / "slice");
    const Outcome outcome = run_lamina(use, directory.path());
    EXPECT_EQ(outcome.code, 5);
    EXPECT_EQ(outcome.error_lines(), 1u) << outcome.err;
    EXPECT_NE(outcome.err.find("manifest.json:"), std::string::npos) << outcome.err;
    EXPECT_NE(outcome.err.find("of another version of lamina"), std::string::npos) << outcome.err;
    EXPECT_TRUE(tree_text(directory.path() / "jet") == jet);
    EXPECT_TRUE(tree_text(directory.path() / "slice") == slice);
  }
}

TEST(OldManifest, JobsOfAnOlderBuildOfThisVersionGoOn) {
  struct Kept {
    std::vector<std::string> job;
    std::string name, layer;  // a file of layer 1; empty: one file of all
  };
  const std::vector<Kept> jobs = {
      {{"jet", "--bed", "14x24", "--dpi", "100"}, "images", "layers/000001.tif"},
      {{"jet", "--machine", "nuferbj"}, "nuferbj", "program/000001.gcode"},
      {{"slice"}, "contours", ""},
  };
  for (const Kept& kept : jobs) {
    SCOPED_TRACE(kept.name);
    const Directory directory;
    fs::copy(fs::path(LAMINA_TEST_DIR) / "golden/kept_jobs" / kept.name, directory.path() / kept.name,
             fs::copy_options::recursive);
    const fs::path manifest = directory.path() / kept.name / "manifest.json";
    if (read_text(manifest).find('"' + std::string(version()) + '"') == std::string::npos) GTEST_SKIP() << "another version";
    const auto bytes = [&] {  // all but the manifest, which tells the time of layers that are made now
      std::string all;
      for (const std::string& file : files_below(directory.path() / kept.name)) {
        if (file.ends_with(".tif") || file.ends_with(".gcode") || file.ends_with(".svg") || file.ends_with("machine.toml"))
          all += file + "\n" + read_text(directory.path() / kept.name / file);
      }
      return all;
    };
    const std::string before = bytes();
    ASSERT_FALSE(before.empty());
    std::vector<std::string> line = kept.job;
    for (const std::string& word :
         {corpus_file("parameter_quality_nut.stl"), std::string("--layer"), std::string("12"), std::string("--quiet"),
          std::string("--json"), std::string("--resume"), std::string("-o"), kept.name}) {
      line.push_back(word);
    }
    for (const int still : {2, 1}) {
      if (still == 1 && kept.layer.empty()) break;
      if (still == 1) fs::remove(directory.path() / kept.name / kept.layer);
      const Outcome outcome = run_lamina(line, directory.path());
      ASSERT_EQ(outcome.code, 0) << outcome.err;
      EXPECT_NE(outcome.out.find("\"layers_kept\":" + std::to_string(still)), std::string::npos) << outcome.out;
      EXPECT_TRUE(bytes() == before);
    }
  }
}

TEST(OldManifest, AKeyThatAnOlderBuildLackedIsNamedWhereTheBytesAreOthers) {
  const Directory directory;
  fs::copy(fs::path(LAMINA_TEST_DIR) / "golden/kept_jobs/images", directory.path() / "out", fs::copy_options::recursive);
  const Outcome outcome = run_lamina({"jet", corpus_file("parameter_quality_nut.stl"), "--bed", "14x24", "--dpi", "100",
                                      "--layer", "12", "--quiet", "-o", "out", "--resume", "--title", "order 7"},
                                     directory.path());
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("belongs to another job"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("image.title"), std::string::npos) << outcome.err;
}

}  // namespace
}  // namespace lamina::test
