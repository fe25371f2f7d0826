// tests/formats/test_gcode_modes.cpp: what G90, G91, M82 and M83 mean for E in the firmwares.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <string>

#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::filament_for;
using test::gcode_file;

constexpr const char* kAnyFirmware[] = {"", ";FLAVOR:Marlin\n", ";FLAVOR:RepRap\n", ";FLAVOR:Klipper\n"};

/// E of that many beads of 10 mm, 0.4 wide and 0.2 high.
std::string e_of(double beads) { return fmt::format(" E{:.9f}\n", filament_for(10 * beads, 0.4, 0.2)); }

/// That every bead is 0.4 mm wide.
void expect_widths_hold(const std::string& text, std::size_t beads) {
  const Directory directory;
  const auto file = gcode_file(directory, text);
  ASSERT_TRUE(file) << file.error().message;
  const auto layer = file->layer(0);
  ASSERT_TRUE(layer);
  ASSERT_EQ(layer->beads.size(), beads) << text;
  for (const auto& bead : layer->beads) EXPECT_EQ(bead.width, 400'000) << text;
}

TEST(GcodeModes, HopsThatGoAndComeBackRelativelyLeaveTheBeadsAsTheyAre) {
  const std::string hop = "G91\nG1 E-2 Z0.5\nG1 Z-0.5 E2\nG90\n";
  for (const std::string firmware : {"", ";FLAVOR:Marlin\n", ";FLAVOR:Klipper\n"}) {
    expect_widths_hold(firmware + "M82\nG90\n;HEIGHT:0.2\nG1 Z0.2\nG1 X10" + e_of(1) + hop + "G1 X20" + e_of(2), 2);
  }
  for (const std::string firmware : kAnyFirmware) {
    expect_widths_hold(firmware + "M83\nG90\n;HEIGHT:0.2\nG1 Z0.2\nG1 X10" + e_of(1) + hop + "M83\nG1 X20" + e_of(1), 2);
  }
}

TEST(GcodeModes, OnlyMarlinMakesFeedAbsoluteByG90) {
  for (const std::string firmware : kAnyFirmware) {
    const bool marlin = firmware == ";FLAVOR:Marlin\n";
    expect_widths_hold(firmware + "M83\nG90\n;HEIGHT:0.2\nG1 Z0.2\nG1 X10" + e_of(1) + "G1 X20" + e_of(marlin ? 2 : 1), 2);
  }
}

TEST(GcodeModes, G91MakesFeedRelativeExceptInRepRapFirmware) {
  for (const std::string firmware : kAnyFirmware) {
    const bool apart = firmware == ";FLAVOR:RepRap\n";
    expect_widths_hold(firmware + "M82\nG91\n;HEIGHT:0.2\nG1 Z0.2\nG1 X10" + e_of(1) + "G1 X10" + e_of(apart ? 2 : 1), 2);
  }
}

TEST(GcodeModes, MarlinsM82BehindG91Holds) {
  expect_widths_hold(";FLAVOR:Marlin\nG91\nM82\n;HEIGHT:0.2\nG1 Z0.2\nG1 X10" + e_of(1) + "G1 X10" + e_of(2), 2);
}

TEST(GcodeModes, ALaterLayerIsReadByTheFirmwareOfTheHead) {
  const Directory directory;
  const auto file = gcode_file(directory, ";FLAVOR:Marlin\nM82\n;HEIGHT:0.2\n;LAYER:0\nG1 Z0.2\nG1 X10" + e_of(1) +
                                              ";LAYER:1\nM83\nG90\nG1 X20" + e_of(2) + "G1 X30" + e_of(3));
  ASSERT_TRUE(file) << file.error().message;
  const auto layer = file->layer(1);
  ASSERT_TRUE(layer);
  ASSERT_EQ(layer->beads.size(), 2u);
  for (const auto& bead : layer->beads) EXPECT_EQ(bead.width, 400'000);
}

}  // namespace
}  // namespace lamina
