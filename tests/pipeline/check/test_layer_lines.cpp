// The head of a manifest is held by its hash, and its layers' lines by what they say: jobs as they are written hold, and a
// number that was changed in a line is found.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <array>
#include <regex>
#include <string>
#include <vector>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

const std::regex kHeight("\"bottom_nm\": ([0-9]+), \"thickness_nm\": ([0-9]+)");

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
    SCOPED_TRACE(pattern + " to " + instead);
    expect_reported(std::regex_replace(good, std::regex(pattern), instead, std::regex_constants::format_first_only), what);
  }
  /// The same of a whole manifest.
  void expect_reported(const std::string& text, const std::string& what) const {
    const std::string good = read_text(directory_ / "out/manifest.json");
    EXPECT_NE(text, good);
    write_text(directory_ / "out/manifest.json", text);
    const Outcome verified = run("verify out");
    write_text(directory_ / "out/manifest.json", good);
    EXPECT_EQ(verified.code, 5) << verified.out << verified.err;
    EXPECT_NE(verified.err.find(what), std::string::npos) << what << "\n" << verified.err;
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

/// Bottoms and thicknesses of a manifest's layers.
std::vector<std::array<int, 2>> heights_of(const std::string& manifest) {
  std::vector<std::array<int, 2>> heights;
  for (std::sregex_iterator found(manifest.begin(), manifest.end(), kHeight), last; found != last; ++found)
    heights.push_back({std::stoi((*found)[1]), std::stoi((*found)[2])});
  return heights;
}

/// The manifest with the boundary on top of a layer so many nm higher, as if it had been made so.
std::string with_moved_boundary(const std::string& manifest, std::size_t layer, int by) {
  std::string text;
  auto end = manifest.begin();
  std::size_t index = 0;
  for (std::sregex_iterator found(manifest.begin(), manifest.end(), kHeight), last; found != last; ++found, ++index) {
    const int below = index == layer ? by : 0, above = index == layer + 1 ? by : 0;
    text.append(end, (*found)[0].first);
    text += fmt::format("\"bottom_nm\": {}, \"thickness_nm\": {}", std::stoi((*found)[1]) + above,
                        std::stoi((*found)[2]) + below - above);
    end = (*found)[0].second;
  }
  return text.append(end, manifest.end());
}

/// The first boundary between layers of two thicknesses, exchanged: both are the job's.
std::string with_exchanged_layers(const std::string& manifest) {
  const auto heights = heights_of(manifest);
  for (std::size_t i = 0; i + 1 < heights.size(); ++i) {
    const int by = heights[i + 1][1] - heights[i][1];
    if (by != 0) return with_moved_boundary(manifest, i, by);
  }
  ADD_FAILURE() << "all layers are as thick";
  return manifest;
}

// Where layers differ, each has a thickness that the job allows.
TEST_F(LayerLines, ThicknessesThatTheJobDoesNotHaveAreFound) {
  const struct {
    const char *heights, *what;
  } rows[] = {{"optimal --thickness 0.2..0.4:0.05", "nm thick, by the manifest, which is not a thickness of the job"},
              {"angle --thickness 0.2,0.4", "which is not a thickness of the job"},
              {"cusp --cusp 0.08 --thickness 0.2..0.4:0.05", "which is not a thickness of the job"},
              {"stepwise --cusp 0.05 --thickness 0.1..0.4:0.05", "divides no slab of 400000 nm evenly"}};
  for (const auto& [heights, what] : rows) {
    make("jet " + corpus_file("dental_crown.stl") + " --bed 30,30 --dpi 60 --heights " + heights);
    const std::string good = read_text(directory_ / "out/manifest.json");
    EXPECT_NE(with_exchanged_layers(good), good) << heights;
    for (const std::size_t layer : {0, 3, 10}) {
      for (const int by : {-1, 1, -7'000, 20'000}) expect_reported(with_moved_boundary(good, layer, by), what);
    }
  }
}

// The layer thickness that programs state, and images of a job with a title.
TEST_F(LayerLines, ThicknessesOfOtherLayersAreFoundByWhatDistinguishesThem) {
  const std::string part = "jet " + corpus_file("dental_crown.stl") + " --heights optimal --thickness 0.2,0.3,0.4 --format ";
  for (const char* machine : {"nuferbj", "hp45", "oasis", "reprap-inkjet", "brundlefab", "xaar128-raw", "jet1000"}) {
    make(part + "png --machine " + machine);
    expect_reported(with_exchanged_layers(read_text(directory_ / "out/manifest.json")), "program/00");
  }
  for (const char* format : {"tiff-g4", "tiff-none"}) {
    make(part + format + " --bed 30,30 --dpi 60 --title layer");
    expect_reported(with_exchanged_layers(read_text(directory_ / "out/manifest.json")), "mm, the manifest says layer ");
  }
  make(part + "tiff-8 --levels 4 --bed 30,30 --dpi 60 --title z");
  expect_reported(with_exchanged_layers(read_text(directory_ / "out/manifest.json")), "mm, the manifest says layer ");
  // Nothing else does.
  make(part + "png --bed 30,30 --dpi 60");
  write_text(directory_ / "out/manifest.json", with_exchanged_layers(read_text(directory_ / "out/manifest.json")));
  EXPECT_EQ(run("verify out").code, 0);
}

TEST_F(LayerLines, TimesOfAddedSweepsAreThoseOfThePrograms) {
  const std::string slow =
      "inherits = \"jet1000-grey\"\n[bed]\nsize_mm = [20, 20]\nmargin_mm = 0\n[head]\nhighest_frequency_hz = 6000\n[machine]\nname = \"slow\"\n";
  const struct {
    const char *dialect, *motion, *maintenance;
  } rows[] = {{"planes", "", ""},
              {"planes", "both_directions = false\n", ""},
              {"raw", "acceleration_mm_s2 = 3000\n", ""},
              {"raw", "", "[maintenance]\nspit_layers = 1\nspit_seconds = 5\nspit_drops = 20\nspit_mm = [-40, -10]\n"}};
  for (const auto& [dialect, motion, maintenance] : rows) {
    write_text(directory_ / "slow.toml", slow + "dialect = \"" + dialect + "\"\n[motion]\n" + motion + maintenance);
    make("jet a.stl b.stl --machine slow.toml --layer 0.1 --saturation 90");
    const std::string good = read_text(directory_ / "out/manifest.json");
    std::smatch found;
    ASSERT_TRUE(std::regex_search(good, found, std::regex("\"added_microseconds\": ([0-9]+)"))) << good;
    const int added = std::stoi(found[1]);
    EXPECT_GT(added, 100'000) << dialect;
    for (const int other : {0, added / 2, added - 3, added + 3, -added}) {
      expect_found("\"added_microseconds\": [0-9]+", fmt::format("\"added_microseconds\": {}", other),
                   fmt::format(" s are for sweeps that the head's frequency adds, the manifest says {:.6f}", other * 1e-6));
    }
  }
}

TEST_F(LayerLines, NothingLiesInAnotherPowderWhereThereIsOne) {
  make("jet a.stl --machine nuferbj --layer 0.1 --saturation 70 --images drops");
  expect_found("\"unfed_pixels\": 0", "\"unfed_pixels\": 3", "the job uses one powder, the manifest says 3 pixels");
}

}  // namespace
}  // namespace lamina::test
