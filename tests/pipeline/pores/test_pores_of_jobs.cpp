// tests/pipeline/pores/test_pores_of_jobs.cpp: lamina permeability of a job says what it says of the job's files.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <array>
#include <nlohmann/json.hpp>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

constexpr const char* kFilament =
    "[machine]\nprofile = \"anet-a8\"\n\n[layers]\nthickness_mm = 0.3\n\n[fill]\npattern = \"raster\"\nangle_deg = 90\n"
    "angle_step_deg = 0\n\n[segment]\non = true\n\n[[part]]\npath = \"part.stl\"\n";
constexpr const char* kPowder =
    "[bed]\nsize_mm = [30, 30]\ndpi = 600\n\n[layers]\nthickness_mm = 0.1\n\n[fill]\npattern = \"raster\"\nwidth_mm = 0.4\n"
    "gap_mm = 0.3\n\n[[part]]\npath = \"part.stl\"\n";

void write_two_jobs(const Directory& folder) {
  write_box(folder / "part.stl", {0, 0, 0}, {10, 10, 1.5F});
  write_box(folder / "other.stl", {0, 0, 0}, {20, 14, 3});
  write_text(folder / "filament.toml", kFilament);
  write_text(folder / "powder.toml", kPowder);
}

Outcome reported(const std::string& line, const Directory& folder) { return run_lamina(words_of(line), folder.path()); }

/// The report of a job without the job itself.
nlohmann::ordered_json without_job(const std::string& text) {
  nlohmann::ordered_json json = nlohmann::ordered_json::parse(text);
  json.erase("job");
  return json;
}

TEST(PoresOfJobs, AJobOfFilamentHasThePoresOfItsToolpaths) {
  Directory folder;
  write_two_jobs(folder);
  ASSERT_EQ(reported("extrude --job filament.toml --quiet -o part.gcode", folder).code, 0);
  const auto file = reported("permeability part.gcode --voxel 30 --json", folder);
  const auto job = reported("permeability filament.toml --voxel 30 --json", folder);
  ASSERT_EQ(job.code, 0) << job.err;
  EXPECT_EQ(without_job(job.out), nlohmann::ordered_json::parse(file.out));
  EXPECT_EQ(job.err, file.err);
  const nlohmann::ordered_json said = nlohmann::ordered_json::parse(job.out)["job"];
  EXPECT_EQ(said["path"], "filament.toml");
  EXPECT_EQ(said["command"], "extrude");
  EXPECT_EQ(said["machine"], "Anet A8");
  EXPECT_EQ(said["layers"], 5);
  EXPECT_EQ(said["parts"][0], "part.stl");
  const auto text = reported("permeability filament.toml --voxel 30 --no-flow", folder);
  EXPECT_EQ(text.out.rfind("job       filament.toml: planned as lamina extrude does, 5 layers of 0.3 mm, Anet A8\n", 0), 0u)
      << text.out;
}

TEST(PoresOfJobs, TheCommandedAccelerationDecidesAndItsUncertaintyIsReported) {
  Directory folder;
  write_two_jobs(folder);
  ASSERT_EQ(reported("extrude other.stl --job filament.toml --quiet -o part.gcode", folder).code, 0);
  std::string text = read_text(folder / "part.gcode");
  const std::size_t at = text.find("M204 P500 T500\n");
  ASSERT_NE(at, std::string::npos);
  const auto k1_with = [&](const std::string& acceleration) {
    std::string other = text;
    write_text(folder / "other.gcode", other.replace(at, 14, "M204 P" + acceleration));
    const auto done = reported("permeability other.gcode --voxel 20 --json", folder);
    EXPECT_EQ(done.code, 0) << done.err;
    EXPECT_NE(done.err.find("lag 0.047 s, " + acceleration + " mm/s2 as commanded"), std::string::npos) << done.err;
    const nlohmann::ordered_json json = nlohmann::ordered_json::parse(done.out);
    const double k1 = json["flow"][2]["k1_darcy"];
    EXPECT_LE(json["k1_range_darcy"][0], 0.8 * k1 + 1e-9);
    EXPECT_GE(json["k1_range_darcy"][1], 1.43 * k1 - 1e-9);
    return k1;
  };
  const double slow = k1_with("400"), usual = k1_with("500"), fast = k1_with("1000");
  EXPECT_LT(slow, usual);
  EXPECT_LT(usual, fast);
  EXPECT_NEAR(fast / usual, 1.43, 0.35) << "about as in bench/pores.md";
}

TEST(PoresOfJobs, APrinterThatNothingWasMeasuredOnIsWarnedOf) {
  Directory folder;
  write_two_jobs(folder);
  ASSERT_EQ(reported("extrude --job filament.toml --machine marlin --quiet -o part.gcode", folder).code, 0);
  for (const auto& [beads, text] :
       {std::pair{"stated", "Marlin has no calibration of its own"}, {"spread", "Marlin states no lag of its melt"}}) {
    const auto done = reported(std::string("permeability part.gcode --no-flow --voxel 30 --json --beads ") + beads, folder);
    ASSERT_EQ(done.code, 0) << done.err;
    EXPECT_NE(done.err.find(std::string("warning   ") + text), std::string::npos) << done.err;
    const nlohmann::ordered_json json = nlohmann::ordered_json::parse(done.out);
    ASSERT_EQ(json["warnings"].size(), 1u) << beads;
    EXPECT_EQ(json["warnings"][0]["code"], "calibration");
  }
}

TEST(PoresOfJobs, AJobOfPowderHasThePoresOfItsBitmaps) {
  Directory folder;
  write_two_jobs(folder);
  ASSERT_EQ(reported("jet --job powder.toml --quiet -o job", folder).code, 0);
  const auto files = reported("permeability job --window 1,1,0.4 --periodic z --json", folder);
  const auto job = reported("permeability powder.toml --window 1,1,0.4 --periodic z --json", folder);
  ASSERT_EQ(job.code, 0) << job.err;
  EXPECT_EQ(without_job(job.out), nlohmann::ordered_json::parse(files.out));
  EXPECT_EQ(nlohmann::ordered_json::parse(job.out)["job"]["command"], "jet");
}

TEST(PoresOfJobs, OptionsAndPartsGoBeforeWhatTheJobSays) {
  Directory folder;
  write_two_jobs(folder);
  const std::string set = " --set segment.thin_mm=2 --machine anet-a8";
  ASSERT_EQ(reported("extrude other.stl --job filament.toml --quiet -o other.gcode" + set, folder).code, 0);
  const auto file = reported("permeability other.gcode --no-flow --json", folder);
  const auto job = reported("permeability filament.toml other.stl --no-flow --json" + set, folder);
  ASSERT_EQ(job.code, 0) << job.err;
  EXPECT_EQ(without_job(job.out), nlohmann::ordered_json::parse(file.out));
  EXPECT_EQ(nlohmann::ordered_json::parse(job.out)["window_mm"][1], 3.5) << "a period of 1.5 and 2 mm";
}

TEST(PoresOfJobs, TheWindowLiesInTheMiddleOfTheFirstOfSeveralParts) {
  Directory folder;
  write_two_jobs(folder);
  write_text(folder / "both.toml",
             std::string(kFilament) + "at_mm = [20, 30]\n\n[[part]]\npath = \"other.stl\"\nat_mm = [100, 100]\n");
  const auto both = reported("permeability both.toml --no-flow", folder);
  ASSERT_EQ(both.code, 0) << both.err;
  EXPECT_NE(both.out.find(" around 25.00, 35.00 mm, one layer from layer 2 on"), std::string::npos) << both.out;
  EXPECT_EQ(reported("permeability both.toml --no-flow --window 11,3,0.3", folder).code, 2) << "the first part is 10 mm wide";
}

TEST(PoresOfJobs, NothingIsLeftBehind) {
  Directory folder;
  write_two_jobs(folder);
  std::filesystem::create_directory(folder / "tmp");
  const char* before = ::getenv("TMPDIR");
  const std::string kept = before == nullptr ? "" : before;
  ::setenv("TMPDIR", (folder / "tmp").c_str(), 1);
  const auto well = reported("permeability filament.toml --no-flow", folder);
  const auto badly = reported("permeability filament.toml --window 90,1,1", folder);
  before == nullptr ? ::unsetenv("TMPDIR") : ::setenv("TMPDIR", kept.c_str(), 1);
  EXPECT_EQ(well.code, 0) << well.err;
  EXPECT_EQ(badly.code, 2);
  EXPECT_EQ(badly.err.rfind("lamina: filament.toml: --window", 0), 0u) << badly.err;
  EXPECT_EQ(badly.err.find("lamina_permeability"), std::string::npos) << "no name of a file that is gone: " << badly.err;
  EXPECT_TRUE(std::filesystem::is_empty(folder / "tmp"));
}

TEST(PoresOfJobs, AWrongJobIsALine) {
  Directory folder;
  write_two_jobs(folder);
  const std::string unknown = "[layers]\nthickness_mm = 0.3\n", part = "\n[[part]]\npath = \"part.stl\"\n";
  write_text(folder / "unknown.toml", unknown + part);
  write_text(folder / "key.toml", unknown + "thick = 1\n");
  write_text(folder / "no_part.toml", unknown);
  write_text(folder / "walls.toml", "[machine]\nprofile = \"anet-a8\"\n[fill]\npattern = \"none\"\n" + part);
  write_text(folder / "solid.toml", "[bed]\ndpi = 300\n" + unknown + part);
  const struct {
    const char* line;
    int code;
    const char* words;
  } rows[] = {
      {"permeability unknown.toml", 2, "unknown.toml: names no machine, and may be of filament or of powder; add --machine"},
      {"permeability key.toml", 2, "key.toml:3:9: layers.thick: no such key"},
      {"permeability no_part.toml", 2, "no_part.toml: no part to plan"},
      {"permeability none.toml", 2, "none.toml: no such job file"},
      {"permeability filament.toml none.stl", 3, "none.stl: cannot be opened"},
      {"permeability filament.toml --machine ender", 2, "--machine: no machine 'ender'"},
      {"permeability filament.toml --machine fdm-2000", 2, "filament.toml: FDM 2000 writes sml"},
      {"permeability filament.toml --set segment.thick_mm=0", 2, "segment.thick_mm: 0 mm; a thick segment has to be longer"},
      {"permeability filament.toml --set segment.thin_mm=30", 2, "segment.thin_mm"},
      {"permeability filament.toml --length 5", 2, "--length is for tables of measurements"},
      {"permeability filament.toml --periodic z", 2, "--periodic is for folders of images"},
      {"permeability powder.toml --beads stated", 2, "--beads is for toolpaths"},
      {"permeability walls.toml", 3, "walls.toml: no bead lies in the window of 2.000 x 2.000"},
      {"permeability part.gcode --set layers.thickness_mm=1", 2, "--set is for job files"},
  };
  for (const auto& row : rows) expect_refused(row.line, row.code, row.words, folder);
  const auto empty = reported("permeability walls.toml --no-flow", folder);
  EXPECT_NE(empty.err.find("note: walls.toml: no bead"), std::string::npos) << empty.err << "and not the file that it became";
  const auto solid = reported("permeability solid.toml", folder);
  EXPECT_EQ(solid.code, 0) << solid.err;
  EXPECT_NE(solid.out.find("no connected void"), std::string::npos) << "a solid part is reported as solid";
}

}  // namespace
}  // namespace lamina::test
