// The head of a manifest is held by its hash, and its layers' lines by what they say: jobs as they are written hold, and a
// number that was changed in a line is found.
#include <gtest/gtest.h>

#include <regex>
#include <string>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

class LayerLines : public ::testing::Test {
 protected:
  void SetUp() override {
    write_box(directory_ / "a.stl", {0, 0, 0}, {8, 6, 0.6F});
    write_box(directory_ / "b.stl", {0, 0, 0}, {4, 4, 0.3F});
  }
  Outcome run(const std::string& command) const { return run_lamina(words_of(command), directory_.path()); }
  void make(const std::string& command) const {
    const Outcome made = run(command + " --quiet --overwrite -o out");
    ASSERT_EQ(made.code, 0) << made.err;
    const Outcome verified = run("verify out");
    ASSERT_EQ(verified.code, 0) << verified.err;
  }
  /// The first match in a line of a layer is another one; the manifest is as it was afterwards.
  void expect_found(const std::string& pattern, const std::string& instead, const std::string& what) const {
    const std::string good = read_text(directory_ / "out/manifest.json");
    const std::string text = std::regex_replace(good, std::regex(pattern), instead, std::regex_constants::format_first_only);
    EXPECT_NE(text, good) << pattern;
    write_text(directory_ / "out/manifest.json", text);
    const Outcome verified = run("verify out");
    write_text(directory_ / "out/manifest.json", good);
    EXPECT_EQ(verified.code, 5) << pattern << " to " << instead << verified.out << verified.err;
    EXPECT_NE(verified.err.find(what), std::string::npos) << verified.err;
  }

  Directory directory_;
};

TEST_F(LayerLines, SweepsAreThoseOfThePrograms) {
  for (const char* machine : {"nuferbj", "brundlefab", "hp45"}) {
    make(std::string("jet a.stl --layer 0.1 --machine ") + machine);
    expect_found("\"sweeps\": ([0-9]+)", "\"sweeps\": 9$1", "sweeps fire, the manifest says 9");
    expect_found("\"sweeps\": ([0-9]+)", "\"sweeps\": 0", "sweeps fire, the manifest says 0");
  }
}

// A table of costs shares by them.
TEST_F(LayerLines, PartsHaveAllOfTheirLayer) {
  make("jet a.stl b.stl --machine nuferbj --layer 0.1 --saturation 70 --quote quote.csv");
  expect_found("\\{\"set\": [0-9]+\\}", "{\"set\": 7}", "layer 0: its parts have ");
  expect_found("\\{\"set\": [0-9]+\\}", "{\"set\": 0}", "pixels of all");
  expect_found("\\{\"drops\": [0-9]+\\}", "{\"drops\": 7}", "drops of all");
}

TEST_F(LayerLines, LayersLieOnEachOther) {
  make("jet a.stl --bed 20,20 --dpi 300 --layer 0.1");
  expect_found("\"bottom_nm\": 0,", "\"bottom_nm\": 5,", "layer 0: begins 0 nm above the bed, the manifest says 5");
  expect_found("\"bottom_nm\": 300000", "\"bottom_nm\": 300001", "layer 3: begins 300000 nm above the bed");
  expect_found("\"thickness_nm\": 100000", "\"thickness_nm\": 90000", "layer 0: is 100000 nm thick as all of the job");
}

TEST_F(LayerLines, LayersOfSeveralThicknessesDoToo) {
  make("jet a.stl --bed 20,20 --dpi 300 --heights optimal --thickness 0.05..0.2:0.05");
  expect_found("\"bottom_nm\": 0,", "\"bottom_nm\": 5,", "layer 0: begins 0 nm above the bed");
  expect_found("\"thickness_nm\": ", "\"thickness_nm\": 1", "layer 1: begins 1");
}

TEST_F(LayerLines, NothingLiesInAnotherPowderWhereThereIsOne) {
  make("jet a.stl --machine nuferbj --layer 0.1 --saturation 70");
  expect_found("\"unfed_pixels\": 0", "\"unfed_pixels\": 3", "the job is of one powder, the manifest says 3 pixels");
}

}  // namespace
}  // namespace lamina::test
