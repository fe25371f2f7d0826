// tests/formats/test_gcode_layers.cpp: G-code files read back as beads.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "stages/data/contours.h"
#include "stages/formats/gcode/read_gcode.h"
#include "tests/commands/program.h"
#include "tests/segment/gcode_reader.h"

namespace lamina::pipeline {
namespace {

using test::Directory;
using test::Outcome;
using test::run_lamina;

Point2 at(double x_mm, double y_mm) { return {static_cast<Nm>(nm_of(x_mm)), static_cast<Nm>(nm_of(y_mm))}; }

std::string nut() { return std::string(LAMINA_TEST_DIR) + "/corpus/parameter_quality_nut.stl"; }

/// `text` as a file, read.
Result<formats::GcodeFile> file_of(const Directory& directory, const std::string& text) {
  test::write_text(directory.path() / "part.gcode", text);
  return formats::GcodeFile::open(directory / "part.gcode");
}

TEST(GcodeLayers, ASegmentedPlanHasTheBeadsThatAnotherReaderFinds) {
  for (const std::string machine : {"anet-a8", "klipper"}) {
    const Directory directory;
    const Outcome planned = run_lamina({"extrude", nut(), "--machine", machine, "--layer", "0.3", "--fill", "segmented",
                                        "--angle", "30", "-o", "part.gcode", "--quiet"},
                                       directory.path());
    ASSERT_EQ(planned.code, 0) << planned.err;
    const auto expected = test::read_gcode(test::read_text(directory.path() / "part.gcode"));
    ASSERT_EQ(expected.error, "");
    const auto file = formats::GcodeFile::open(directory / "part.gcode");
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_TRUE(file->states_widths());
    ASSERT_EQ(file->count(), expected.layers.size());
    std::size_t beads = 0;
    for (std::uint32_t k = 0; k < file->count(); ++k) {
      const auto layer = file->layer(k);
      ASSERT_TRUE(layer) << layer.error().message;
      std::vector<test::GcodeBead> wanted = expected.layers[k].beads;
      if (k == 0) wanted.insert(wanted.begin(), expected.skirt.begin(), expected.skirt.end());
      std::erase_if(wanted, [](const test::GcodeBead& b) {  // shorter than a micrometre
        return b.filament == 0 || (b.x0 == b.x1 && b.y0 == b.y1);
      });
      ASSERT_EQ(layer->beads.size(), wanted.size()) << "layer " << k;
      EXPECT_TRUE(wanted.empty() || layer->z == nm_of(expected.layers[k].z));
      for (std::size_t i = 0; i < wanted.size(); ++i) {
        const formats::GcodeBead& bead = layer->beads[i];
        EXPECT_EQ(bead.from, at(wanted[i].x0, wanted[i].y0));
        EXPECT_EQ(bead.to, at(wanted[i].x1, wanted[i].y1));
        EXPECT_EQ(bead.width, nm_of(wanted[i].width));
        EXPECT_EQ(file->types()[bead.type], wanted[i].type);
      }
      beads += wanted.size();
    }
    EXPECT_GT(beads, 10'000u);
  }
}

// What CuraEngine writes has no widths: 10 mm of a bead 0.4 mm wide and 0.2 mm high hold this much filament of 1.75 mm.
constexpr double kFed = 10 * (0.2 * 0.2 + std::numbers::pi * 0.01) / (std::numbers::pi * 1.75 * 1.75 / 4);

TEST(GcodeLayers, WidthsFollowFromWhatIsFedWhereNoTagStatesThem) {
  const Directory directory;
  const std::string fed = std::to_string(kFed), twice = std::to_string(2 * kFed);
  const auto file = file_of(directory,
                            "M82\nG28\nG92 E0\nG1 X1 Y1 Z0.2 F600\nG1 X90 E9 ; primes\nG92 E0\n;LAYER:0\n;TYPE:WALL-OUTER\n"
                            "G0 X10 Y10\nG1 X20 E" +
                                fed + "\nG1 F1200 E-2\nG0 X50 Y50 Z1\nG0 Z0.2\nG1 E" + fed +
                                "\n;LAYER:1\nG1 Z.4\nG1 X50 Y60 E" + twice + "\n;LAYER:2\n");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_FALSE(file->states_widths());
  ASSERT_EQ(file->count(), 3u);
  const auto first = file->layer(0), second = file->layer(1), empty = file->layer(2);
  ASSERT_TRUE(first && second && empty);
  ASSERT_EQ(first->beads.size(), 1u);
  EXPECT_EQ(first->beads[0].width, 400'000);
  EXPECT_EQ(file->types()[first->beads[0].type], "WALL-OUTER");
  ASSERT_EQ(second->beads.size(), 1u);
  EXPECT_EQ(second->beads[0].width, 400'000);
  EXPECT_EQ(second->z, 400'000);
  EXPECT_TRUE(empty->beads.empty());
  EXPECT_EQ(file->box().lo.x, 9'800'000) << "the line in front of the first layer belongs to none";
}

TEST(GcodeLayers, TheDiameterOfTheFilamentIsReadWhereItIsStated) {
  const Directory directory;
  const std::string fed = std::to_string(kFed * 1.75 * 1.75 / 9);
  const auto file = file_of(directory, "M83\nG1 Z0.2\nG1 X10 E" + fed + "\n; filament_diameter = 3\n");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->layer(0)->beads[0].width, 400'000);
}

TEST(GcodeLayers, WithoutTagsLayersAreHeightsAtWhichSomethingIsDeposited) {
  const Directory directory;
  const auto file = file_of(directory,
                            "G20 ; inches\nM83\nG91\nG1 Z0.01\nG1 X1 E.1\nG0 Z0.1\nG1 X1\nG1 Z-0.1\nG1 Y1 E0.1\nG90\n"
                            "N12 G1 Z0.02 E-1*71\nG1 E1\nG01 X+2.5 Y0 E.1 (back)\nG1 Z1\n");
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->count(), 2u);
  EXPECT_EQ(file->layer(0)->beads.size(), 2u);
  const auto second = file->layer(1);
  ASSERT_EQ(second->beads.size(), 1u);
  EXPECT_EQ(second->beads[0].from, (Point2{50'800'000, 25'400'000}));
  EXPECT_EQ(second->beads[0].to, (Point2{63'500'000, 0}));
}

TEST(GcodeLayers, WhatCannotBeDrawnIsOneLineThatNamesThePosition) {
  const Directory directory;
  const std::vector<std::pair<std::string, std::string>> files = {
      {"", "no move extrudes filament"},
      {"solid nut\nfacet normal 0 0 0\n", "no move extrudes filament"},
      {std::string("GIF89a\0\0\0", 9), "line 1: is no text of G-code"},
      {"G28\n" + std::string(1 << 17, 'x'), "line 2: is no text of G-code"},
      {"G1 X1 E1\nG18\nG2 X1 Y1 I1 E2\n", "line 3: an arc in the plane of G18"},
      {"M83\nG1 Xnan E1\n", "line 2: 'nan' is not a number"},
      {"G1 X1..2 E1\n", "line 1: '.2 E1' is no word of a move"},
      {"G1 X1000000000 E1\n", "line 1: a bead at 1e+09 mm; beds are at most 2000 mm wide"},
      {"M83\nG1 X1 E-100\nG2 I9999999999999999 E10\n", "line 3: a bead at 6.28319e+07 mm; beds are at most 2000 mm wide"},
      {";WIDTH:wide\nG1 X1 E1\n", "line 1: 'wide' is not a length"},
  };
  for (const auto& [text, reported] : files) {
    const auto file = file_of(directory, text);
    ASSERT_FALSE(file) << reported;
    EXPECT_NE(file.error().message.find(reported), std::string::npos) << file.error().message;
    EXPECT_EQ(file.error().message.find('\n'), std::string::npos);
  }
  EXPECT_FALSE(formats::GcodeFile::open(directory / "none.gcode"));
}

TEST(GcodeLayers, TagsWithoutEndAreRefusedWithTheLine) {
  const Directory directory;
  std::string text = "M83\n";
  for (int i = 0; i < 6; ++i) text += ";LAYER:0\nG1 X" + std::to_string(i + 1) + " E1\n";
  test::write_text(directory.path() / "part.gcode", text + "M107\n");
  for (const std::uint32_t maximum : {5u, 6u}) {
    formats::GcodeOptions options;
    options.max_layers = maximum;
    const auto file = formats::GcodeFile::open(directory / "part.gcode", options);
    EXPECT_EQ(file.ok(), maximum == 6u);
    if (file) continue;
    EXPECT_NE(file.error().message.find("line 12: more than 5 layers"), std::string::npos) << file.error().message;
  }
}

}  // namespace
}  // namespace lamina::pipeline
