// Options that would do nothing are refused with what they need.
#include <gtest/gtest.h>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

TEST(Needs, OptionsWithoutEffectAreRefused) {
  const Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {20, 10, 5});
  write_text(directory / "binding.toml", "[powder]\nmin_saturation_percent = 1\n");
  const struct {
    const char *call, *flag, *remedy;  // remedy: makes it an option with an effect
  } rows[] = {
      {"jet", "--cusp 0.1", "--heights cusp --thickness 0.5,1"},
      {"jet", "--adapt-angle 30", "--heights angle --thickness 0.5,1"},
      {"jet", "--time-model 1", "--heights optimal --thickness 0.5,1"},
      {"slice", "--no-flats", "--heights optimal --thickness 0.5,1"},
      {"slice", "--facet-area 1", "--heights stepwise --thickness 0.5,1"},
      {"jet", "--shell 1", "--core 0.5"},
      {"jet", "--bead-ends square", "--walls 1"},
      {"jet", "--bead 0.5", "--fill raster"},
      {"slice", "--bead-gap 1", "--pattern raster"},
      {"slice", "--angle 45", "--pattern raster"},
      {"slice", "--stagger 0,0.1", "--set fill.pattern=raster"},
      {"extrude", "--bead-gap 1", "--fill raster --machine anet-a8 --layer 0.2"},
      {"jet", "--first-layers 3", "--first-bleed 50"},
      {"jet", "--min-wall 1", "--inspect"},
      {"jet", "--gap 3", "--copies 2"},
      {"slice", "--angle 30 --pattern contour", "--pattern raster"},
      {"slice", "--angle-step 30 --pattern contour", "--pattern raster"},
      {"slice", "--stagger 0,0.1", "--pattern contour"},
      {"slice", "--top-layers 3", "--pattern grid --density 20"},
      {"extrude", "--bottom-layers 3 --fill raster", "--density 20 --layer 0.2"},
      {"slice", "--file-a-layer --format null", "--format svg"},
      {"jet", "--allow-unbound", "--machine hp45 --preset binding.toml"},
      {"jet", "--allow-unbound --machine hp45", "--preset binding.toml"},
      {"jet", "--vat-rule first --machine nuferbj", "part.stl --material steel,bronze"},
  };
  const auto run = [&](const std::string& line) { return run_lamina(words_of(line), directory.path()); };
  for (const auto& row : rows) {
    const std::string line = std::string(row.call) + " part.stl --layer 1 --dry-run " + row.flag;
    const Outcome refused = run(line);
    const std::string flag = std::string(row.flag).substr(0, std::string(row.flag).find(' '));
    EXPECT_EQ(refused.code, 2) << line << "\n" << refused.err;
    EXPECT_EQ(refused.error_lines(), 1u) << refused.err;
    EXPECT_NE(refused.err.find(flag + ": applies to "), std::string::npos) << refused.err;
    const Outcome done = run(line + " " + row.remedy);
    EXPECT_EQ(done.code, 0) << line << " " << row.remedy << "\n" << done.err;
  }
  EXPECT_EQ(run("extrude part.stl --bead 0.5 --dry-run").code, 0) << "a wall is deposited anyway";
}

TEST(Needs, KeysWithoutEffectAreNoted) {
  const Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {20, 10, 5});
  const auto notes = [&](const std::string& keys, const std::string& options) {
    write_text(directory / "job.toml", keys + "\n[[part]]\npath = 'part.stl'\n");
    const Outcome outcome = run_lamina(words_of(options + " --job job.toml --layer 1 --dry-run"), directory.path());
    EXPECT_EQ(outcome.code, 0) << keys << "\n" << outcome.err;
    return outcome.err;
  };
  EXPECT_NE(notes("[dose]\nfirst_layers = 3", "jet").find("note: dose.first_layers: applies to --first-bleed"),
            std::string::npos);
  EXPECT_NE(notes("[run]\nmin_wall_mm = 3", "jet").find("note: run.min_wall_mm: applies to --inspect"), std::string::npos);
  EXPECT_NE(notes("", "jet --set dose.first_layers=3").find("note: dose.first_layers: applies to"), std::string::npos);
  for (const char* keys : {"[dose]\nfirst_layers = 1", "[dose]\nfirst_layers = 3\nfirst_bleed_um = 50"}) {
    EXPECT_EQ(notes(keys, "jet").find("applies to"), std::string::npos) << keys;
  }
  EXPECT_EQ(notes("[dose]\nfirst_layers = 3", "slice").find("applies to"), std::string::npos) << "a key of lamina jet";
}

TEST(Needs, WhatMachinesIgnoreIsRefused) {
  const Directory directory;
  expect_refused("machines --preset example-steel", 2, "--preset: applies to --check and --show", directory);
  expect_refused("machines --target f.stl --check hp45", 2, "--target: is written alone", directory);
}

}  // namespace
}  // namespace lamina::test
