// The margin of the bed, the thinnest wall, and messages for numbers and names that are nearly right.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

struct Margin : testing::Test {
  Directory folder;
  void SetUp() override { write_box(folder / "part.stl", {0, 0, 0}, {20, 10, 5}); }
  Outcome done(const std::string& line) const {
    Outcome outcome = run_lamina(words_of(line), folder.path());
    EXPECT_EQ(outcome.code, 0) << line << "\n" << outcome.err;
    return outcome;
  }
  bool says(const std::string& line, const std::string& words) const {
    const Outcome outcome = done(line);
    return (outcome.out + outcome.err).find(words) != std::string::npos;
  }
};

TEST_F(Margin, KeepsArrangedPartsOffTheEdges) {
  const std::string jet = "jet part.stl --layer 1 --dpi 100 --dry-run --gap 0 ";
  done(jet + "--bed 40x20 --copies 4");
  expect_refused(jet + "--bed 40x20 --copies 4 --margin 1", 2, "with a margin of 1 mm, 2 mm of depth are missing", folder);
  done(jet + "--bed 42x22 --copies 4 --margin 1");
}

TEST_F(Margin, OfAMachineAppliesUnlessTheJobHasItsOwn) {
  write_box(folder / "wide.stl", {0, 0, 0}, {295, 100, 2});
  const std::string jet = "jet wide.stl --machine jet1000 --layer 1 --dry-run ";
  expect_refused(jet, 2, "is larger than the bed of 300 x 200 mm without its margin of 5 mm; use a smaller --margin", folder);
  done(jet + "--margin 0");
  EXPECT_TRUE(says(jet + "--at 1,1", "lies in the margin of 5 mm"));
  write_text(folder / "job.toml", "[bed]\nmargin_mm = 2\n[machine]\nprofile = 'jet1000'\n[[part]]\npath = 'wide.stl'\n");
  done("jet --job job.toml --layer 1 --dry-run --save-job saved.toml");
  EXPECT_NE(read_text(folder / "saved.toml").find("margin_mm = 2"), std::string::npos);
  for (const char* machine : {"nuferbj", "hp45", "oasis", "brundlefab", "reprap-inkjet"})
    EXPECT_FALSE(says(std::string("machines --show ") + machine, "margin_mm = 5")) << machine;
  EXPECT_TRUE(says("machines --show production-1200", "margin_mm = 5"));
}

TEST_F(Margin, DoesNotMoveImagesOfAWholeBed) {
  done("jet part.stl --machine jet1000 --layer 1 --quiet -o out");
  done("jet out/layers --machine jet1000 --layer 1 --quiet -o again");
  EXPECT_EQ(tree_text(folder.path() / "again/layers"), tree_text(folder.path() / "out/layers"));
}

TEST_F(Margin, ThinWallsAreThoseOfThePowder) {
  const auto inspected = [&](float wide, const std::string& options) {
    write_box(folder / "fin.stl", {0, 0, 0}, {wide, 12, 4});
    return done("jet fin.stl --layer 0.5 --dry-run --inspect " + options).err;
  };
  EXPECT_NE(inspected(0.2f, "--bed 30x30").find("fin.stl: "), std::string::npos);
  EXPECT_NE(inspected(0.2f, "--bed 30x30").find("narrower than 0.3 mm"), std::string::npos);
  EXPECT_EQ(inspected(0.4f, "--bed 30x30").find("narrower"), std::string::npos);
  EXPECT_NE(inspected(0.8f, "--machine hp45 --preset example-steel").find("narrower than 1 mm"), std::string::npos);
  EXPECT_EQ(inspected(0.8f, "--machine hp45 --preset example-steel --min-wall 0.5").find("narrower"), std::string::npos);
}

TEST_F(Margin, DecimalCommasAndNearlyRightNamesGetAHint) {
  for (const char* line : {"jet part.stl --dry-run --layer 0,05", "jet part.stl --dry-run --set layers.thickness_mm=0,05",
                           "jet part.stl --dry-run --scale 0,05", "jet part.stl --dry-run --threads 0,05",
                           "jet part.stl --dry-run --memory 0,05G", "heights part.stl --layer 0,05"})
    expect_refused(line, 2, "decimal numbers have a point, as 0.05", folder);
  EXPECT_TRUE(says("jet part.stl --layer 1 --dry-run --dpi 540,43", "note: --dpi 540,43: is two numbers"));
  expect_refused("jet part.stl --dry-run --format tif", 2, "did you mean 'tiff-g4'?", folder);
  expect_refused("slice part.stl --dry-run --format tif", 2, "is a format of images, which lamina jet writes", folder);
  expect_refused("extrude part.stl -o new/", 2, "names a directory; name a file in it, as in new/part.gcode", folder);
  EXPECT_TRUE(says("extrude part.stl -o out", "note: -o out: is written as one file; end its name with .gcode"));
  EXPECT_EQ(done("help jet").out, done("jet --help").out);
}

}  // namespace
}  // namespace lamina::test
