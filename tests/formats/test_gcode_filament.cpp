// tests/formats/test_gcode_filament.cpp: widths of beads by the filament that files tell, or a person.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "stages/formats/gcode/commands.h"
#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::filament_for;
using test::gcode_file;

/// A line of 10 mm, 0.4 wide and 0.2 high, of filament of that diameter.
std::string line_of(double diameter_mm) {
  return fmt::format("M83\nG1 Z0.2\nG1 X10 E{:.9f}\n", filament_for(10, 0.4, 0.2, diameter_mm));
}

TEST(GcodeFilament, WhatIsFedAndWhatItsFilamentWeighsIsReported) {
  const Directory directory;
  const double area = 1.75 * 1.75 * test::kPi / 4;
  // Beads alone count: no start code before the first layer, no retraction, no priming.
  const std::string beads = "M83\nG1 Z0.2\nG1 X10 E9\n;LAYER_CHANGE\nG1 X20 E2\nG1 E-1\nG0 X0\nG1 E1\nG1 X20 E0.5\nG1 E3\n";
  const auto file = gcode_file(directory, beads);
  ASSERT_TRUE(file.ok());
  EXPECT_NEAR(file->fed_mm3(), 2.5 * area, 1e-9);
  EXPECT_EQ(file->density_g_cm3(), 0);
  // A diameter that is told behind the beads counts; E of M200 is mm3.
  EXPECT_NEAR(gcode_file(directory, beads + "; filament_diameter = 2.85\n")->fed_mm3(), 2.5 * 2.85 * 2.85 * test::kPi / 4,
              1e-9);
  EXPECT_NEAR(gcode_file(directory, "M200 D1.75\n" + beads)->fed_mm3(), 2.5, 1e-9);
  const std::vector<std::pair<std::string, double>> reported = {
      {"; filament_density = 1.27,1.24\n", 1.27},
      {"; filament_density: 1.04\n", 1.04},
      {"; filament used [cm3] = 2.00\n; filament used [g] = 2.48\n", 1.24},
      {"; filament_density = 1.3\n; filament used [cm3] = 2.00\n; filament used [g] = 2.48\n", 1.3},
      {"; filament used [cm3] = 0.20\n; filament used [g] = 0.26\n; filament_density = 1.24\n", 1.24},
      {"; filament used [cm3] = 0.01\n; filament used [g] = 0.02\n", 0},  // two digits say nothing of so little
      {"; filament_density = 0\n", 0}};
  for (const auto& [text, density] : reported)
    EXPECT_NEAR(gcode_file(directory, beads + text)->density_g_cm3(), density, 1e-9) << text;
}

TEST(GcodeFilament, EverySlicerStatesItsDiameter) {
  const Directory directory;
  // Made with Python:
  // base64.b64encode(zlib.compress(b"layer_height=0.1\x08...not_filament_diameter=9\x08filament_diameter=2.85...
  const std::string profile =
      ";CURA_PROFILE_STRING:eJzLSaxMLYrPSM1MzyixNdAz5ChPzMmJL8nITM7OSy0uBgpZcOTll8SnZeYk5qbmlcSnZALpktQiW0sOTDEjPQtTTGEjWwOexB"
      "wgIy+xJLMsFQB98Sn4";
  const std::vector<std::pair<std::string, double>> files = {
      {"; filament_diameter = 2.85", 2.85},
      {"; filament_diameter = 2.85,1.75", 2.85},
      {"; filament_diameter: 1.75,1.75,1.75", 1.75},
      {";   filamentDiameters,2.85|1.75|1.75", 2.85},
      {";   filamentDiameter,3", 3},
      {"; fiber_dia_mm = 3", 3},
      {";Filament Diameter #1: 2.85", 2.85},
      {";Filament used: 2.5m 18.9g", 2.85},
      {";Filament used: 1.20047m 3.58g", 1.75},
      {";FLAVOR:Griffin", 2.85},
      {";SETTING_3 {\"global_quality\": \"[values]\\\\nmaterial_diameter = 2.85\\\\nspeed", 2.85},
      {profile, 2.85},
      {profile + "\n; filament_diameter = 3", 3},
      {";Filament used: 1.3m 9.1g\n" + profile, 2.85},
      {"M200 D1.75", 2 / std::sqrt(std::numbers::pi)},  // E counts mm3
      {";FLAVOR:UltiGCode", 2 / std::sqrt(std::numbers::pi)},
      {"; use_volumetric_e = 1", 2 / std::sqrt(std::numbers::pi)},
  };
  for (const auto& [comment, diameter] : files) {
    const auto file = gcode_file(directory, comment + "\n" + line_of(diameter));
    ASSERT_TRUE(file) << file.error().message;
    const auto layer = file->layer(0);
    ASSERT_TRUE(layer);
    EXPECT_EQ(layer->beads[0].width, 400'000) << comment;
    EXPECT_TRUE(file->notes().empty()) << comment;
  }
}

TEST(GcodeFilament, WhatStatesNothingIsTakenForNothing) {
  const Directory directory;
  for (const std::string comment :
       {"; filament_diameter = nil", "; filament_diameter = 0", "; filament_diameter = -3", "; filament_diameter = 1e9",
        "; min_filament_diameter_check = 5", ";Filament used: #F_AMNT#m #F_WGHT#g", ";Filament used: 1.20047m",
        ";Filament used: 0m 0g", ";CURA_PROFILE_STRING:", ";CURA_PROFILE_STRING:####", ";CURA_PROFILE_STRING:AAAA", ";",
        "; =", ";#diameter", "; diameter #", "M200 D0", "; use_volumetric_e = 0"}) {
    const auto file = gcode_file(directory, comment + "\n" + line_of(1.75));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(file->layer(0)->beads[0].width, 400'000) << comment;
  }
}

TEST(GcodeFilament, AProfileThatInflatesWithoutEndIsCutOff) {
  // 40 MB of zeros, deflated by Python: 40 kB; the start of the stream is enough to fill what is kept.
  std::string zeros = "eJzt";
  zeros.append(60'000, 'A');
  EXPECT_EQ(formats::cura_profile_number(zeros, "filament_diameter"), 0);
}

TEST(GcodeFilament, ThinBeadsAreReportedAndAGivenDiameterWins) {
  const Directory directory;
  const std::string text = "M83\n;LAYER:0\nG1 Z0.2\n;TYPE:WALL-OUTER\n" + line_of(2.85);
  const auto thin = gcode_file(directory, text);
  ASSERT_TRUE(thin);
  EXPECT_LT(thin->layer(0)->beads[0].width, 200'000);
  ASSERT_EQ(thin->notes().size(), 1u);
  EXPECT_EQ(
      thin->notes()[0],
      "beads are 0.18 mm wide on average by filament of 1.75 mm, of which the file says nothing, less than half of a nozzle of "
      "0.4 mm; if the filament is another, name it by --filament MM, as 2.85");
  const auto wide = gcode_file(directory, text + "; filament_diameter = 1.75\n", {.filament_mm = 2.85});
  ASSERT_TRUE(wide);
  EXPECT_EQ(wide->layer(0)->beads[0].width, 400'000);
  EXPECT_TRUE(wide->notes().empty());
  // With the nozzle that the file names; tags of widths are believed.
  for (const std::string nozzle :
       {"; nozzle_diameter = 0.25", ";EXTRUDER_TRAIN.0.NOZZLE.DIAMETER:0.25", ";   extruderDiameter,0.25"}) {
    EXPECT_TRUE(gcode_file(directory, text + nozzle + "\n")->notes().empty()) << nozzle;
  }
  EXPECT_TRUE(gcode_file(directory, ";WIDTH:0.1\n" + text)->notes().empty());
}

TEST(GcodeFilament, TagsOfBambuStudioAreThoseOfPrusaSlicer) {
  const Directory directory;
  const std::string moves = "G1 Z0.2\nG1 X10 E1\n", next = "G1 Z0.5\nG1 X20 E1\n";
  const auto file = gcode_file(directory,
                               "M83\n; CHANGE_LAYER\n; Z_HEIGHT: 0.2\n; LAYER_HEIGHT: 0.2\n; FEATURE: Outer wall\n"
                               "; LINE_WIDTH: 0.42\n" +
                                   moves + "; CHANGE_LAYER\n; LINE_WIDTH: 0.5\n" + next);
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->count(), 2u);
  EXPECT_EQ(file->layer(0)->beads[0].width, 420'000);
  EXPECT_EQ(file->layer(1)->beads[0].width, 500'000);
  EXPECT_EQ(file->types()[file->layer(1)->beads[0].type], "Outer wall");
}

TEST(GcodeFilament, BinaryFilesAreNamedWithWhatToDo) {
  const Directory directory;
  const auto binary = gcode_file(directory, std::string("GCDE\1\0\0\0\1\0\0\0", 12));
  ASSERT_FALSE(binary);
  EXPECT_NE(binary.error().message.find("is binary G-code; make text of it with `bgcode FILE`"), std::string::npos);
  const auto zipped = gcode_file(directory, std::string("PK\3\4\24\0\0\0", 8));
  ASSERT_FALSE(zipped);
  EXPECT_NE(zipped.error().message.find("unzip FILE Metadata/plate_1.gcode"), std::string::npos);
}

/// Length in mm of a file's beads by type, and their mean width.
struct BeadsOfType {
  double length = 0, area = 0;
  double width() const { return area / length; }
};

std::map<std::string, BeadsOfType> measured(const formats::GcodeFile& file, std::uint32_t first, std::uint32_t last) {
  std::map<std::string, BeadsOfType> types;
  for (std::uint32_t k = first; k < last; ++k) {
    const auto layer = file.layer(k);
    if (!layer) return {};
    for (const formats::GcodeBead& bead : layer->beads) {
      const double length = std::hypot(mm(std::int64_t{bead.to.x} - bead.from.x), mm(std::int64_t{bead.to.y} - bead.from.y));
      types[file.types()[bead.type]].length += length;
      types[file.types()[bead.type]].area += length * mm(bead.width);
    }
  }
  return types;
}

TEST(ThirdPartyGcode, CuraFor285mmHasBeadsAsWideAsItsNozzle) {
  const std::string path = test::third_party_gcode("cura14_filament_2.85.gcode");
  if (path.empty()) GTEST_SKIP() << "LAMINA_MODELS is not set: no file of Cura 14 was read";
  const auto file = formats::GcodeFile::open(path);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->filament_mm(), 2.85);  // in its CURA_PROFILE_STRING
  EXPECT_TRUE(file->notes().empty());
  EXPECT_EQ(file->count(), 70u);  // ";Layer count: 70"
  // "Walls: 0.8" with a nozzle of 0.4 are two lines of 0.4 mm; the profile's flow is 100 %, and Cura's beads are rectangles.
  for (const auto& [type, beads] : measured(*file, 1, 60)) {
    EXPECT_NEAR(beads.width(), 0.42, 0.03) << type;
  }
  const auto thin = formats::GcodeFile::open(path, {.filament_mm = 1.75});
  ASSERT_EQ(thin->notes().size(), 1u);
  EXPECT_NE(thin->notes()[0].find("check --filament"), std::string::npos);
}

/// The file with arcs alone: of lines "G1 ..." the E is taken away, and every tag of widths if `no_widths`.
std::string arcs_alone(const std::string& text, bool no_widths) {
  std::istringstream lines(text);
  std::string arcs;
  for (std::string line; std::getline(lines, line);) {
    if (no_widths && line.starts_with(";WIDTH:")) continue;
    arcs += (line.starts_with("G1 ") ? line.substr(0, line.find(" E")) : line) + '\n';
  }
  return arcs;
}

// PrusaSlicer feeds for a rectangle with half circles as wide as its ;WIDTH: tags say: without the tags, what is fed over the
// length of the chords of each arc must lead to the same widths.
TEST(ThirdPartyGcode, ArcsOfPrusaSlicerAreAsLongAsWhatIsFedForThem) {
  const std::string path = test::third_party_gcode("prusaslicer_arcs.gcode");
  if (path.empty()) GTEST_SKIP() << "LAMINA_MODELS is not set: no file of PrusaSlicer was read";
  const auto whole = formats::GcodeFile::open(path);
  ASSERT_TRUE(whole) << whole.error().message;
  EXPECT_TRUE(whole->notes().empty());
  EXPECT_TRUE(whole->states_widths());
  EXPECT_EQ(whole->count(), 174u);
  const Directory directory;
  const std::string text = test::read_text(path);
  test::write_text(directory.path() / "tagged.gcode", arcs_alone(text, false));
  const auto tagged = formats::GcodeFile::open(directory / "tagged.gcode");
  const auto fed = gcode_file(directory, arcs_alone(text, true));
  ASSERT_TRUE(tagged && fed);
  EXPECT_FALSE(fed->states_widths());
  ASSERT_EQ(fed->count(), tagged->count());
  std::size_t chords = 0, equal = 0;
  for (std::uint32_t k = 0; k < fed->count(); ++k) {
    const auto by_tag = tagged->layer(k), by_feed = fed->layer(k);
    ASSERT_TRUE(by_tag && by_feed && by_tag->beads.size() == by_feed->beads.size());
    chords += by_tag->beads.size();
    for (std::size_t i = 0; i < by_tag->beads.size(); ++i) {
      equal += std::abs(by_tag->beads[i].width - by_feed->beads[i].width) <= 15'000 ? 1 : 0;
    }
  }
  EXPECT_GT(chords, 2 * 3592u);
  EXPECT_GT(static_cast<double>(equal), 0.97 * static_cast<double>(chords));
}

}  // namespace
}  // namespace lamina
