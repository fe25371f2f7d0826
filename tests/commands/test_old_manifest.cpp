// tests/commands/test_old_manifest.cpp: directories as lamina of commit ef3e1c3 left them, tests/golden/old_manifest: what
// reads them says in one line that another version wrote them, and changes nothing.
#include <gtest/gtest.h>

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

}  // namespace
}  // namespace lamina::test
