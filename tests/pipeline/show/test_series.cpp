// tests/pipeline/show/test_series.cpp: layers of G-code, drawn.
#include "pipeline/show/series.h"

#include <gtest/gtest.h>

#include <numbers>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "tests/commands/program.h"

namespace lamina::pipeline {
namespace {

using test::Directory;
using test::Outcome;
using test::run_lamina;

std::string nut() { return std::string(LAMINA_TEST_DIR) + "/corpus/parameter_quality_nut.stl"; }

TEST(PreviewGcode, BeadsCoverTheirLengthTimesTheirWidthAndRoundEnds) {
  const Directory directory;
  test::write_text(directory.path() / "part.gcode",
                   "M83\n;TYPE:Internal infill\n;HEIGHT:0.2\n;WIDTH:0.3\nG1 X0 Y0 Z0.2\nG1 X10 E1\n;WIDTH:0.5\nG0 Y5\n"
                   "G1 X0 E1\n;TYPE:External perimeter\nG0 X0 Y9\nG1 X10 E1\n");
  const auto series = gcode_series(directory / "part.gcode");
  ASSERT_TRUE(series) << series.error().message;
  EXPECT_EQ(series->count, 1u);
  const auto shapes = series->layer(0);
  ASSERT_TRUE(shapes) << shapes.error().message;
  ASSERT_EQ(shapes->beads.size(), 3u);
  const double widths[] = {0.3, 0.5, 0.5};
  const std::string names[] = {"Internal infill 0.3 mm", "Internal infill 0.5 mm", "External perimeter 0.5 mm"};
  for (std::size_t i = 0; i < 3; ++i) {
    const double covered = square_mm(doubled_area(shapes->beads[i].outline));
    EXPECT_NEAR(covered, 10 * widths[i] + std::numbers::pi * widths[i] * widths[i] / 4, 0.01);
    EXPECT_EQ(shapes->beads[i].name, names[i]);
  }
  EXPECT_NE(shapes->beads[0].ink, shapes->beads[1].ink) << "thin and thick segments are distinguished";
  EXPECT_NE(shapes->beads[1].ink, shapes->beads[2].ink);
  EXPECT_FALSE(series->layer(1));
}

TEST(PreviewGcode, WidthsThatRoundingPartsAreOneShade) {
  const Directory directory;
  std::string text = "M83\n;TYPE:Internal infill\n;HEIGHT:0.2\nG1 X0 Y0 Z0.2\n";
  for (const std::string width : {"0.44", "0.45", "0.44", "0.6", "0.45"}) text += ";WIDTH:" + width + "\nG91\nG1 X10 E1\nG90\n";
  test::write_text(directory.path() / "part.gcode", text);
  const auto series = gcode_series(directory / "part.gcode");
  ASSERT_TRUE(series) << series.error().message;
  const auto shapes = series->layer(0);
  ASSERT_TRUE(shapes) << shapes.error().message;
  ASSERT_EQ(shapes->beads.size(), 2u);
  EXPECT_EQ(shapes->beads[0].name, "Internal infill 0.44 to 0.45 mm");
  EXPECT_EQ(shapes->beads[1].name, "Internal infill 0.6 mm");
  EXPECT_EQ(shapes->beads[0].type, shapes->beads[1].type);
}

TEST(PreviewGcode, DrawsLayersOfAPlanAsPngAndSvg) {
  const Directory directory;
  ASSERT_EQ(
      run_lamina({"extrude", nut(), "--layer", "0.3", "--fill", "segmented", "-o", "part.gcode", "--quiet"}, directory.path())
          .code,
      0);
  const Outcome svg = run_lamina({"preview", "part.gcode", "-o", "part.svg", "--layer", "3"}, directory.path());
  ASSERT_EQ(svg.code, 0) << svg.err;
  const std::string drawn = test::read_text(directory.path() / "part.svg");
  for (const std::string name : {"\"External perimeter 0.4", "\"Internal infill 0.3", "\"Internal infill 0.4"}) {
    EXPECT_NE(drawn.find("<path class=" + name), std::string::npos) << name;
  }
  for (const std::vector<std::string>& more : {std::vector<std::string>{"--layer", "3"}, {"--count", "4"}, {}}) {
    std::vector<std::string> arguments = {"preview", "part.gcode", "-o", "part.png", "--width", "600"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome png = run_lamina(arguments, directory.path());
    ASSERT_EQ(png.code, 0) << png.err;
    EXPECT_EQ(test::read_text(directory.path() / "part.png").substr(1, 3), "PNG");
  }
  const Outcome far = run_lamina({"preview", "part.gcode", "-o", "part.png", "--layer", "99"}, directory.path());
  EXPECT_EQ(far.code, 2);
  EXPECT_NE(far.err.find("--layer 99: the file has layers 0 to "), std::string::npos) << far.err;
  const Outcome bed = run_lamina({"preview", "part.gcode", "-o", "part.png", "--whole-bed"}, directory.path());
  EXPECT_EQ(bed.code, 2);
  EXPECT_EQ(bed.error_lines(), 1u) << bed.err;
}

TEST(PreviewGcode, FilamentAndLayerHeightAreForGcodeAndNotesAreSaid) {
  const Directory directory;
  test::write_text(directory.path() / "thick.gcode", "M83\nG1 Z0.2\nG1 X10 E0.12\nG1 X0 Y9 Z0.3 E0.12\n");
  const auto preview = [&](const std::string& line) { return run_lamina(test::words_of("preview " + line), directory.path()); };
  const Outcome thin = preview("thick.gcode -o a.svg --layer 0");
  ASSERT_EQ(thin.code, 0) << thin.err;
  EXPECT_NE((thin.out + thin.err).find("thick.gcode: beads are 0.1"), std::string::npos) << thin.err;
  const Outcome wide = preview("thick.gcode -o b.svg --layer 0 --filament 2.85 --layer-height 0.5");
  ASSERT_EQ(wide.code, 0) << wide.err;
  EXPECT_EQ((wide.out + wide.err).find("beads are"), std::string::npos) << wide.err;
  EXPECT_NE((wide.out + wide.err).find("layer 0 of 1 "), std::string::npos) << wide.err;
  for (const auto& [line, reported] : std::vector<std::pair<std::string, std::string>>{
           {"thick.gcode -o c.png --filament 0", "--filament 0: "},
           {"thick.gcode -o c.png --filament thick", "--filament thick: "},
           {"thick.gcode -o c.png --layer-height 1e9", "--layer-height 1e9: "},
           {". -o c.png --filament 2.85", "--filament, --layer-height: are for G-code files"}}) {
    test::expect_refused("preview " + line, 2, reported, directory);
  }
}

}  // namespace
}  // namespace lamina::pipeline
