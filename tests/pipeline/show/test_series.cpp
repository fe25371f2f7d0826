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
  EXPECT_NE(shapes->beads[0].ink, shapes->beads[1].ink) << "thin and thick stretches can be told apart";
  EXPECT_NE(shapes->beads[1].ink, shapes->beads[2].ink);
  EXPECT_FALSE(series->layer(1));
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

}  // namespace
}  // namespace lamina::pipeline
