// What killed runs left is removed by the next run of the same output, and what live ones write is not.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>

#include "pipeline/output/temporary_folder.h"
#include "stages/support/io/file.h"
#include "stages/support/io/temporary.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

namespace fs = std::filesystem;

const std::string kEnding = ".lamina-abcdefghijklm.part";

struct Leftovers : ::testing::Test {
  Leftovers() {
    write_box(directory_ / "part.stl", {0, 0, 0}, {6, 4, 3});
    EXPECT_EQ(run("jet part.stl --layer 1 --dpi 60 --quiet -o made").code, 0);
  }
  Outcome run(const std::string& line) { return run_lamina(words_of(line), directory_.path()); }

  Directory directory_;
};

TEST_F(Leftovers, OfConvertExportDesignAndJetAreRemoved) {
  for (const char* output : {"c/", "c"}) {
    fs::create_directory(directory_ / "c");
    write_text(directory_ / ("c/000002.bmp" + kEnding), "torn");
    write_text(directory_ / ("c/000123.tif" + kEnding), "of another format and a longer stack");
    write_text(directory_ / ("c/notes" + kEnding), "of no image");
    write_text(directory_ / "c/000001.bmp.part", "of somebody else");
    ASSERT_EQ(run("convert made/layers --format bmp --quiet -o " + std::string(output)).code, 0);
    EXPECT_EQ(files_below(directory_ / "c"),
              (std::vector<std::string>{"000000.bmp", "000001.bmp", "000001.bmp.part", "000002.bmp", "notes" + kEnding}));
    fs::remove_all(directory_ / "c");
  }
  for (const auto& [line, name] : {std::pair<std::string, std::string>{"export part.stl --quiet -o x.stl", "x.stl"},
                                   {"export part.stl --quiet -o x.3mf", "x.3mf"},
                                   {"design --pore 0.12x0.9 --machine anet-a8 --voxel 50 --quiet -o x.toml", "x.toml"},
                                   {"jet part.stl --layer 1 --dpi 60 --quiet -o made --resume", "made/inspection-1-of-2.zst"},
                                   {"jet part.stl --layer 1 --dpi 60 --quiet -o made --resume", "made/inspection.json"}}) {
    write_text(directory_ / (name + kEnding), "torn");
    const Outcome outcome = run(line);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_FALSE(fs::exists(directory_ / (name + kEnding))) << line;
  }
}

TEST_F(Leftovers, OfLiveRunsStay) {
  const auto sections = File::open(directory_ / "made/inspection-1-of-2.zst");
  ASSERT_TRUE(sections.ok());
  ASSERT_EQ(run("jet part.stl --layer 1 --dpi 60 --quiet -o made --resume").code, 0);
  const auto names = files_below(directory_ / "made");
  EXPECT_TRUE(std::ranges::any_of(names, [](const std::string& name) { return name.ends_with(".part"); }));
  // A job writes its layers without locks, under one of its record.
  const std::string layer = directory_ / ("made/layers/000009.png" + kEnding);
  write_text(layer, "growing");
  ASSERT_EQ(run("jet part.stl --layer 1 --dpi 60 --quiet -o other").code, 0);
  for (const char* record : {"made/manifest.json", "made/manifest-1-of-2.json"}) {
    const auto claim = Claim::take(directory_ / record, directory_ / record);
    ASSERT_TRUE(claim.ok());
    const Outcome refused = run("convert other/layers --format png --quiet -o made/layers");
    EXPECT_EQ(refused.code, 4) << refused.err;
    EXPECT_TRUE(fs::exists(layer));
  }
}

TEST(TemporaryFolder, OfAKilledRunIsRemovedAndThatOfALiveOneStays) {
  const Directory directory;
  const char* before = std::getenv("TMPDIR");
  const std::string kept = before != nullptr ? before : "";
  ::setenv("TMPDIR", directory.path().c_str(), 1);
  for (const char* name : {"lamina_test_killed", "lamina_test_vacant", "lamina_test_living", "lamina_other_killed"})
    fs::create_directory(directory / name);
  fs::create_directory(directory / "lamina_test_notes");  // somebody's
  for (const char* name : {"lamina_test_killed", "lamina_test_living", "lamina_test_notes", "lamina_other_killed"})
    write_text(directory / (std::string(name) + "/.lamina-lock"), "");
  write_text(directory / "lamina_test_killed/block.gcode", "torn");
  const int live = ::open((directory / "lamina_test_living/.lamina-lock").c_str(), O_WRONLY);
  ASSERT_EQ(::flock(live, LOCK_EX), 0);
  {
    const pipeline::TemporaryFolder folder("test"), other("test");
    EXPECT_TRUE(folder.status().ok() && other.status().ok());
    EXPECT_TRUE(fs::exists(folder.file(".lamina-lock")) && fs::exists(other.file(".lamina-lock"))) << "not those of each other";
    EXPECT_FALSE(fs::exists(directory / "lamina_test_killed"));
    EXPECT_FALSE(fs::exists(directory / "lamina_test_vacant"));
  }
  EXPECT_EQ(files_below(directory.path()),
            (std::vector<std::string>{"lamina_other_killed/.lamina-lock", "lamina_test_living/.lamina-lock",
                                      "lamina_test_notes/.lamina-lock"}));
  ::close(live);
  kept.empty() ? ::unsetenv("TMPDIR") : ::setenv("TMPDIR", kept.c_str(), 1);
}

}  // namespace
}  // namespace lamina::test
