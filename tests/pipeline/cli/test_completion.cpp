// The completion of the shells: bash completes as at a prompt; zsh and fish check the script if they are installed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

/// A folder with files of several kinds, and what bash completes there.
struct Completion : testing::Test {
  Directory folder;
  void SetUp() override {
    write_text(folder / "lamina.bash", run_lamina({"completion", "bash"}, folder.path()).out);
    for (const char* name : {"bracket.stl", "LID.STL", "job.toml", "notes.txt", "widths.csv", "beads.gcode", "beads.sml"}) {
      write_text(folder / name, "x");
    }
    std::filesystem::create_directory(folder / "parts");
  }
  /// The candidates for the last word of a line.
  std::vector<std::string> candidates(const std::string& line) const {
    const std::string script = "cd '" + folder.path().string() + "'; HOME=$PWD; source ./lamina.bash; COMP_WORDS=(" + line +
                               "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _lamina; printf '%s\\n' \"${COMPREPLY[@]}\" > stated";
    write_text(folder / "request.bash", script);
    EXPECT_EQ(std::system(("bash '" + (folder / "request.bash") + "'").c_str()), 0) << line;
    std::istringstream reported(read_text(folder / "stated"));
    std::vector<std::string> words;
    for (std::string word; std::getline(reported, word);) {
      if (!word.empty()) words.push_back(word);
    }
    std::ranges::sort(words);
    return words;
  }
};

bool holds(const std::vector<std::string>& words, const std::string& word) {
  return std::ranges::find(words, word) != words.end();
}

TEST_F(Completion, ValuesAreWordsThatTheOptionTakes) {
  const struct {
    const char *line, *candidate;
  } rows[] = {
      {"lamina jet --format ''", "tiff-g4"},
      {"lamina jet --engine ''", "contours"},
      {"lamina jet --machine ''", "nuferbj"},
      {"lamina extrude --machine ''", "anet-a8"},
      {"lamina jet --heights ''", "optimal"},
      {"lamina jet --unit ''", "inch"},
      {"lamina jet --fill ''", "segmented"},
      {"lamina slice --fill-rule ''", "evenodd"},
      {"lamina slice --format ''", "cli-binary"},
      {"lamina heights --format ''", "rp3"},
      {"lamina completion ''", "fish"},
      {"lamina manual ''", "heights"},
      {"lamina machines ''", "klipper"},
      {"lamina machines --show ''", "hp45"},
      {"lamina jet --pattern ''", "contour+raster"},
      {"lamina batch --sync ''", "layer"},
      {"lamina jet --repair ''", "winding"},
      {"lamina jet --format = ''", "tiff-g4"},
  };
  for (const auto& row : rows) {
    const auto words = candidates(row.line);
    EXPECT_TRUE(holds(words, row.candidate)) << row.line;
    EXPECT_FALSE(holds(words, "notes.txt")) << row.line;
  }
  EXPECT_EQ(candidates("lamina jet --engine con"), std::vector<std::string>{"contours"});
  EXPECT_EQ(candidates("lamina jet --dpi ''"), std::vector<std::string>{}) << "a number";
}

TEST_F(Completion, FilesAreThoseOfTheRightEnding) {
  using Words = std::vector<std::string>;
  EXPECT_EQ(candidates("lamina jet ''"), (Words{"LID.STL", "bracket.stl", "parts"}));
  EXPECT_EQ(candidates("lamina jet bracket.stl --job ''"), (Words{"job.toml", "parts"}));
  EXPECT_EQ(candidates("lamina jet -o ''"), Words{"parts"});
  EXPECT_EQ(candidates("lamina calibrate --measured ''"), (Words{"parts", "widths.csv"}));
  EXPECT_EQ(candidates("lamina preview ''"), (Words{"beads.gcode", "parts"}));
  EXPECT_EQ(candidates("lamina verify ''"), (Words{"beads.gcode", "beads.sml", "parts"}));
  EXPECT_EQ(candidates("lamina jet '~/par'"), Words{"~/parts"}) << "below the home folder, which is this one";
  EXPECT_EQ(candidates("lamina jet --machine j"), (Words{"jet1000", "jet1000-grey", "job.toml"}));
  EXPECT_TRUE(holds(candidates("lamina batch ''"), "notes.txt"));
  EXPECT_TRUE(holds(candidates("lamina jet --d"), "--dpi"));
}

// zsh takes a last group without a | as qualifiers of files, and --option=value only where the option's row has the =.
TEST_F(Completion, ZshGetsGroupsOfOneAndOptionsWithEquals) {
  const std::string script = run_lamina({"completion", "zsh"}, folder.path()).out;
  for (const char* part :
       {"'*--job=[", "'*--format=[", "'*-o[", "'*--quiet[", "_files -g \"*.(#i)(toml|)\"", "(stl|obj|3mf|gz|)"}) {
    EXPECT_NE(script.find(part), std::string::npos) << part;
  }
}

TEST_F(Completion, EveryScriptIsOneThatItsShellReads) {
  for (const std::string shell : {"bash", "zsh", "fish"}) {
    const Outcome script = run_lamina({"completion", shell}, folder.path());
    ASSERT_EQ(script.code, 0);
    for (const char* word : {"tiff-g4", "anet-a8", "contours", "toml", "segmented"}) {
      EXPECT_NE(script.out.find(word), std::string::npos) << shell << ": " << word;
    }
    write_text(folder / "script", script.out);
    const std::string check =
        "if command -v " + shell + " > /dev/null; then " + shell + " -n '" + (folder / "script") + "'; fi";
    EXPECT_EQ(std::system(check.c_str()), 0) << shell;
  }
}

}  // namespace
}  // namespace lamina::test
