// tests/calibration/scan/test_calibrate.cpp: lamina calibrate --scan from the command line, on a photograph in a file.
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "pipeline/machine/profiles.h"
#include "stages/calibration/chart/layout.h"
#include "stages/formats/images/image.h"
#include "tests/calibration/scan/synthetic.h"
#include "tests/commands/program.h"

namespace lamina::test {
namespace {

void write_photo(const std::string& path, const GreyPicture& picture) {
  std::ofstream(path, std::ios::binary) << "P5\n"
                                        << picture.width << ' ' << picture.height << "\n255\n"
                                        << std::string(picture.grey.begin(), picture.grey.end());
}

/// The sheet is printed from the layer's file, not from the chart.
TEST(CalibrateScan, APhotographBecomesAProfile) {
  Directory directory;
  ASSERT_EQ(run_lamina(words_of("calibrate --machine nuferbj --quiet -o sheet"), directory.path()).code, 0);
  const auto machine = pipeline::find_machine("nuferbj");
  ASSERT_TRUE(machine);
  const auto resolved = pipeline::resolve_profile(calibration::chart_machine(*machine));
  const auto layer = formats::image(directory / "sheet/print/layers/000000.tif");
  ASSERT_TRUE(resolved && layer);
  Printing printing;
  printing.blocked = {17, 93};
  printing.gain_um = 20;
  std::mt19937_64 random(1);
  const GreyPicture picture = photograph(print_sheet(resolved->grid, layer->runs, printing),
                                         {.pixels_a_mm = 15, .turn_deg = 100, .tilt_x = 0.03}, random);
  write_photo(directory / "photo.pgm", picture);
  const Outcome detected =
      run_lamina(words_of("calibrate --machine nuferbj --chart sheet --scan photo.pgm -o mine.toml --overlay detected.png"),
                 directory.path());
  ASSERT_EQ(detected.code, 0) << detected.err;
  EXPECT_TRUE(std::filesystem::exists(directory / "detected.png"));
  const auto mine = pipeline::find_machine(directory / "mine.toml");
  ASSERT_TRUE(mine) << mine.error().message;
  EXPECT_EQ(mine->head.blocked, (std::vector<std::uint32_t>{17, 93}));
  for (const double um : mine->head.dot_gain_um) EXPECT_NEAR(um, 20, 6);
  // What is no chart, of another machine, or is not there: one line each.
  for (const char* line :
       {"calibrate --machine nuferbj --chart sheet --scan sheet/machine.toml -o no.toml",
        "calibrate --machine nuferbj --chart sheet --scan absent.png -o no.toml",
        "calibrate --machine nuferbj --chart photo.pgm --scan photo.pgm -o no.toml",
        "calibrate --machine hp45 --chart sheet --scan photo.pgm -o no.toml",
        "calibrate --machine nuferbj --chart sheet -o no.toml", "calibrate --machine nuferbj --scan photo.pgm -o no.toml",
        "calibrate --machine nuferbj --weighed-mg 3 -o no.toml"}) {
    const Outcome refused = run_lamina(words_of(line), directory.path());
    EXPECT_TRUE(refused.code == 2 || refused.code == 3) << line << refused.code;
    EXPECT_EQ(refused.error_lines(), 1u) << line << refused.err;
    EXPECT_FALSE(std::filesystem::exists(directory / "no.toml"));
  }
  // Nothing of the chart's directory is replaced, by no name, link or option; a profile of an earlier call is.
  namespace fs = std::filesystem;
  fs::create_symlink("sheet/chart.json", directory / "link");
  fs::create_symlink("sheet/print/layers/000000.tif", directory / "layer");
  fs::create_hard_link(directory / "sheet/chart.json", directory / "hard");
  const std::string before = tree_text(directory / "sheet");
  for (const char* chart : {"sheet", "sheet/", "sheet/chart.json"}) {
    for (const char* output :
         {"-o sheet/chart.json", "-o link", "-o hard", "-o ./sheet/../sheet/chart.json", "-o sheet/print/manifest.json",
          "-o sheet/images/000000.tif", "-o no.toml --overlay sheet/print/layers/000000.tif", "-o no.toml --overlay layer",
          "-o no.toml --overlay sheet/chart.json", "-o no.toml --overlay hard"}) {
      const std::string line =
          std::string("calibrate --machine nuferbj --scan photo.pgm --overwrite --chart ") + chart + " " + output;
      const Outcome refused = run_lamina(words_of(line), directory.path());
      EXPECT_EQ(refused.code, 2) << line;
      EXPECT_EQ(refused.error_lines(), 1u) << line << refused.err;
      EXPECT_TRUE(tree_text(directory / "sheet") == before) << line;
      EXPECT_FALSE(fs::exists(directory / "no.toml")) << line;
    }
  }
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(
        run_lamina(words_of("calibrate --machine nuferbj --chart sheet --scan photo.pgm -o sheet/my.toml"), directory.path())
            .code,
        0);
}

/// A layer of grey drops is compared by where any drop lies: the sheet is printed so.
TEST(CompareScan, AnyDropOfAGreyLayerIsInk) {
  Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {9, 5, 0.3f});
  ASSERT_EQ(
      run_lamina(words_of("jet part.stl --machine jet1000-grey --layer 0.3 --saturation 60 --format tiff-8 --quiet -o job"),
                 directory.path())
          .code,
      0);
  const auto machine = pipeline::find_machine("jet1000-grey");
  ASSERT_TRUE(machine);
  const auto resolved = pipeline::resolve_profile(*machine);
  const auto all = formats::dark_pixels(directory / "job/layers/000000.tif", 255);
  ASSERT_TRUE(resolved && all);
  std::mt19937_64 random(1);
  const GreyPicture picture = photograph(print_sheet(resolved->grid, all->runs, {}), {.pixels_a_mm = 10}, random);
  write_photo(directory / "photo.pgm", picture);
  const Outcome detected =
      run_lamina(words_of("compare job/layers/000000.tif photo.pgm --machine jet1000-grey"), directory.path());
  ASSERT_EQ(detected.code, 0) << detected.err << detected.out;
  EXPECT_NEAR(std::stod(detected.out.substr(detected.out.find("area      ") + 10)), 45, 1) << detected.out;
}

/// A thin core of an image of the geometry is as light on the sheet as its job has it, and no missing stripe.
TEST(CompareScan, ImagesOfTheGeometryAreComparedByTheDropsOfTheirJob) {
  Directory directory;
  write_box(directory / "part.stl", {0, 0, 0}, {24, 16, 0.2f});
  const std::string job = "jet part.stl --machine nuferbj --layer 0.2 --shell 2 --core 0.3 --quiet -o ";
  ASSERT_EQ(run_lamina(words_of(job + "job"), directory.path()).code, 0);
  ASSERT_EQ(run_lamina(words_of(job + "drops --images drops"), directory.path()).code, 0);
  const auto machine = pipeline::find_machine("nuferbj");
  ASSERT_TRUE(machine);
  const auto resolved = pipeline::resolve_profile(*machine);
  const auto printed = formats::image(directory / "drops/layers/000000.tif");
  ASSERT_TRUE(resolved && printed);
  std::mt19937_64 random(1);
  write_photo(directory / "photo.pgm", photograph(print_sheet(resolved->grid, printed->runs, {}), {.pixels_a_mm = 10}, random));
  const auto compared = [&](const std::string& of) {
    return run_lamina(words_of("compare " + of + "/layers/000000.tif photo.pgm --machine nuferbj"), directory.path());
  };
  const Outcome drops = compared("drops"), geometry = compared("job");
  EXPECT_EQ(geometry.code, 0) << geometry.err << geometry.out;
  EXPECT_EQ(geometry.out, drops.out);
  std::filesystem::remove(directory / "job/program/machine.toml");
  const Outcome lost = compared("job");
  EXPECT_EQ(lost.code, 5);
  EXPECT_NE(lost.err.find("job/program/machine.toml: is missing; run lamina verify"), std::string::npos) << lost.err;
}

TEST(CalibrateScan, AMassTooLargeIsReportedByItsOption) {
  Directory directory;
  const Outcome refused =
      run_lamina(words_of("calibrate --machine nuferbj --drops 10 --weighed-mg 1e6 -o no.toml"), directory.path());
  EXPECT_EQ(refused.code, 2);
  EXPECT_EQ(refused.error_lines(), 1u);
  EXPECT_NE(refused.err.find("--weighed-mg: 1e6 of 10 drops"), std::string::npos) << refused.err;
  EXPECT_EQ(refused.err.find("the profile:"), std::string::npos) << refused.err;
}

}  // namespace
}  // namespace lamina::test
