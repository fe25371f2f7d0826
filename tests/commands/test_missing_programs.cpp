// A program that lamina runs, and that is not installed, is named with its package.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdlib>
#include <filesystem>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

class MissingScan : public ::testing::Test {
 protected:
  MissingScan() {
    fs::create_directory(directory_ / "bin");
    fs::copy_file(LAMINA_PROGRAM, directory_ / "bin/lamina");
    EXPECT_EQ(run_lamina(words_of("calibrate --machine nuferbj --quiet -o chart"), directory_.path()).code, 0);
    write_text(directory_ / "photo.png", "photograph");
  }
  /// Runs a copy of the program, alone in its folder, without any PATH.
  void expect_named(const std::string& line, const std::string& reason) {
    const std::string command = "cd '" + directory_.path().string() + "' && PATH=/nowhere bin/lamina " + line + " >said 2>&1";
    EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 2) << line;
    const std::string said = read_text(directory_ / "said");
    for (const std::string& word : {std::string("the program lamina-scan, which is missing"), reason,
                                    std::string("install the Debian package lamina-scan"), std::string("libopencv-core-dev")}) {
      EXPECT_NE(said.find(word), std::string::npos) << said;
    }
    EXPECT_EQ(said.find('\n'), said.size() - 1) << said;
    EXPECT_FALSE(fs::exists(directory_ / "printer.toml"));
  }
  Directory directory_;
};

TEST_F(MissingScan, CalibrateAndCompareNameTheProgramAndItsPackage) {
  expect_named("calibrate --machine nuferbj --chart chart --scan photo.png -o printer.toml", "No such file or directory");
  expect_named("compare chart/images/000000.tif photo.png", "No such file or directory");
}

// What the dynamic linker reports of a program without its libraries.
TEST_F(MissingScan, AProgramWithoutItsLibrariesIsMissingToo) {
  write_text(directory_ / "bin/lamina-scan", "#!/bin/sh\nexit 127\n");
  fs::permissions(directory_ / "bin/lamina-scan", fs::perms::owner_all);
  expect_named("calibrate --machine nuferbj --chart chart --scan photo.png -o printer.toml", "shared library");
}

TEST_F(MissingScan, PreviewWithoutItsProgramIsWrongUseAndNamesThePackage) {
  const std::string command =
      "cd '" + directory_.path().string() + "' && PATH=/nowhere bin/lamina preview chart -o x.png >said 2>&1";
  EXPECT_EQ(WEXITSTATUS(std::system(command.c_str())), 2);
  EXPECT_NE(read_text(directory_ / "said").find("install the Debian package lamina-preview"), std::string::npos);
}

TEST(Names, ARecordWhoseToolpathsAreGoneIsReplacedAndNothingElse) {
  const Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {5, 5, 2});
  const auto code = [&] {
    return run_lamina(words_of("extrude part.stl --machine anet-a8 --quiet -o p.gcode"), directory.path()).code;
  };
  EXPECT_EQ(code(), 0);
  EXPECT_EQ(code(), 2);
  fs::remove(directory / "p.gcode");
  EXPECT_EQ(code(), 0);
  fs::remove(directory / "p.gcode");
  write_text(directory / "p.gcode.json", "{}");
  EXPECT_EQ(code(), 2);
}

TEST(Names, APartOf250BytesIsSlicedToANameThatEndsBetweenCharacters) {
  const Directory directory;
  std::string name;
  while (name.size() < 250) name += "\u00e4";
  write_box(directory / (name + ".stl"), {0, 0, 0}, {5, 5, 2});
  EXPECT_EQ(run_lamina({"slice", name + ".stl", "--quiet", "-o", "out"}, directory.path()).code, 0);
  EXPECT_EQ(run_lamina({"verify", "out"}, directory.path()).code, 0);
}

}  // namespace
}  // namespace lamina::test
