// Options that would do nothing are refused with what they need.
#include <gtest/gtest.h>

#include "tests/commands/program.h"

namespace lamina::test {
namespace {

TEST(Needs, OptionsWithoutEffectAreRefused) {
  const Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {20, 10, 5});
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
      {"extrude", "--angle 45", "--fill segmented --machine anet-a8 --layer 0.2"},
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

}  // namespace
}  // namespace lamina::test
