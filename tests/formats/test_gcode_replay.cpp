// Rules of the replay of G-code, each with the smallest file that breaks it.
#include <gtest/gtest.h>

#include <string>

#include "stages/formats/gcode/replay/defect_text.h"
#include "stages/formats/gcode/replay/replay.h"
#include "tests/commands/program.h"

namespace lamina::formats::gcode {
namespace {

constexpr const char* kHeat = "M104 S210\nM109 S210\nG28\nG90\nM83\n";

/// A square of 20 mm, 0.4 mm wide and 0.2 mm high: 0.03159 mm of filament a mm.
std::string square(double z) {
  return ";LAYER_CHANGE\n;Z:" + std::to_string(z) + "\n;HEIGHT:0.2\n;TYPE:External perimeter\n;WIDTH:0.4\nG1 Z" +
         std::to_string(z) +
         " F600\nG0 X10 Y10 F9000\nG1 X30 Y10 E0.6317 F1800\nG1 X30 Y30 E0.6317\nG1 X10 Y30 E0.6317\nG1 X10 Y10 E0.6317\n";
}

ReplayReport replay(const std::string& text, const ReplayOptions& options = {}) {
  const test::Directory directory;
  test::write_text(directory.path() / "part.gcode", text);
  auto report = replay_gcode(directory / "part.gcode", options);
  EXPECT_TRUE(report) << (report ? "" : report.error().message);
  return report ? *report : ReplayReport();
}

std::string found(const ReplayReport& report) {
  std::string text;
  for (std::size_t k = 0; k < kDefects; ++k) {
    const auto kind = static_cast<Defect>(k);
    if (report.defects[kind].count > 0) text += (text.empty() ? "" : " ") + std::string(defect_name(kind));
  }
  return text;
}

TEST(GcodeReplay, AFileWithoutFaultsHasNone) {
  const ReplayReport report = replay(kHeat + square(0.2) + square(0.4) + square(0.6) + "M104 S0\n");
  EXPECT_EQ(found(report), "");
  EXPECT_EQ(report.totals.layers, 3u);
  EXPECT_EQ(report.totals.beads, 12u);
  EXPECT_NEAR(report.totals.filament_mm, 12 * 0.6317, 1e-9);
  EXPECT_EQ(report.totals.nozzle_degc[0], 210);
  EXPECT_EQ(report.totals.high[0], 30);
}

TEST(GcodeReplay, FilamentIsFedAboveTheFirmwaresMinimum) {
  const std::string square1 = "G28\nG90\nM83\n" + square(0.2);
  EXPECT_EQ(found(replay(square1)), "cold-extrusion");
  EXPECT_EQ(found(replay("M109 S169\n" + square1 + "M104 S0\n")), "cold-extrusion");
  EXPECT_EQ(found(replay("M109 S170\n" + square1 + "M104 S0\n")), "");
  EXPECT_EQ(found(replay(";FLAVOR:RepRap\nM109 S160\n" + square1 + "M104 S0\n")), "");
  EXPECT_EQ(found(replay("M302 P1\n" + square1)), "");
  EXPECT_EQ(found(replay("G10 P0 S210\nM116\n" + square1 + "M104 S0\n")), "");
  // A macro may heat and home.
  EXPECT_EQ(found(replay("START_PRINT BED=60 EXTRUDER=210\nG90\nM83\n" + square(0.2))), "");
  EXPECT_EQ(found(replay(";FLAVOR:UltiGCode\nG90\nM83\n" + square(0.2))), "");
}

TEST(GcodeReplay, HeatWithoutAWaitIsANote) {
  EXPECT_EQ(found(replay("M104 S210\nG28\nG90\nM83\n" + square(0.2) + "M104 S0\n")), "not-waited");
  EXPECT_EQ(found(replay("M104 S210\nM109 S210\nG90\nM83\n" + square(0.2))), "heaters-on not-homed");
}

TEST(GcodeReplay, LayersFollowEachOtherUpwards) {
  EXPECT_EQ(found(replay(kHeat + square(0.2) + square(0.6) + "M104 S0\n")), "skipped-layer");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + square(0.4) + square(0.3) + "M104 S0\n")), "layer-order");
  EXPECT_EQ(found(replay(kHeat + square(-0.2) + "M104 S0\n")), "below-bed");
  EXPECT_EQ(found(replay(kHeat + square(2.2) + "M104 S0\n")), "late-layer");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + ";LAYER_CHANGE\n;Z:0.4\n;HEIGHT:0.2\n" + square(0.6) + "M104 S0\n")),
            "empty-layer");
  // Parts one after another begin again at the bed; a support layer may have a gap above it.
  const std::string two = square(0.2) + square(0.4);
  EXPECT_EQ(found(replay(kHeat + two + "G0 X0 Y10\nG0 X0 Y9\n" + two + "M104 S0\n")), "");
  std::string raft = square(0.2);
  raft.replace(raft.find("External perimeter"), 18, "Support material");
  EXPECT_EQ(found(replay(kHeat + raft + square(0.6) + "M104 S0\n")), "");
  EXPECT_EQ(found(replay(kHeat + raft + ";LAYER_CHANGE\n;Z:0.4\n;HEIGHT:0.2\n" + square(0.6) + "M104 S0\n")), "");
}

TEST(GcodeReplay, WithoutTagsAGapIsComparedWithTheLayersAroundIt) {
  const auto flat = [](double z) {
    const std::string text = square(z);
    return text.substr(text.find("G1 Z"));
  };
  EXPECT_EQ(found(replay(kHeat + flat(0.2) + flat(0.4) + flat(0.6) + flat(0.8) + "M104 S0\n")), "");
  EXPECT_EQ(found(replay(kHeat + flat(0.2) + flat(0.4) + flat(0.8) + flat(1.0) + "M104 S0\n")), "skipped-layer");
  EXPECT_EQ(found(replay(kHeat + flat(0.2) + flat(0.3) + flat(0.5) + flat(0.7) + "M104 S0\n")), "");  // thicker from here on
}

TEST(GcodeReplay, FilamentThatIsDrawnBackIsFedAgain) {
  const auto pause = [](const std::string& back, const std::string& forth, double z) {
    std::string text = square(z);
    text.insert(text.find("G0 X10"), "G1 E" + back + " F2400\n");
    return text.insert(text.find("G1 X30 Y10"), forth.empty() ? "" : "G1 E" + forth + " F2400\n");
  };
  const std::string usual = pause("-1", "1", 0.4) + pause("-1", "1", 0.6);
  EXPECT_EQ(found(replay(kHeat + square(0.2) + usual + pause("-1", "1", 0.8) + "M104 S0\n")), "");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + usual + pause("-1", "", 0.8) + "M104 S0\n")), "not-fed-back");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + usual + pause("-1", "1.5", 0.8) + "M104 S0\n")), "overfed");
  // An extra length of all pauses is a setting.
  EXPECT_EQ(found(replay(kHeat + square(0.2) + pause("-1", "1.5", 0.4) + pause("-1", "1.5", 0.6) + "M104 S0\n")), "");
  // Another tool, or a pause of the print, primes.
  EXPECT_EQ(found(replay(kHeat + square(0.2) + usual + "T1\n" + pause("-1", "5", 0.8) + "M104 S0\n")), "");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + usual + "M600\n" + pause("-1", "5", 0.8) + "M104 S0\n")), "");
}

TEST(GcodeReplay, ALostResetOfEIsAJumpBack) {
  const auto layer = [](double z, const std::string& reset) {
    return ";LAYER_CHANGE\n" + reset + "G1 Z" + std::to_string(z) +
           " F600\nG0 X10 Y10 F9000\nG1 E1 F2400\nG1 X60 Y10 E3\nG1 X60 Y60 E5\nG1 X10 Y60 E7\nG1 E6\n";
  };
  const std::string head = "M109 S210\nG28\nM82\nG92 E0\nG1 E-1 F2400\n";
  EXPECT_EQ(found(replay(head + layer(0.2, "G92 E0\n") + layer(0.4, "G92 E0\n") + "M104 S0\n")), "");
  const ReplayReport lost = replay(head + layer(0.2, "G92 E0\n") + layer(0.4, "G92 E0\n") + layer(0.6, "") + "M104 S0\n");
  EXPECT_EQ(found(lost), "lost-reset");
  EXPECT_EQ(lost.defects[Defect::kLostReset].first.layer, 2u);
  EXPECT_NEAR(lost.defects[Defect::kLostReset].value, 6, 1e-9);
}

TEST(GcodeReplay, BeadsAreDepositedOnce) {
  std::string twice = square(0.2);
  twice += twice.substr(twice.find("G0 X10"));
  const ReplayReport report = replay(kHeat + twice + "M104 S0\n");
  EXPECT_EQ(found(report), "doubled-bead");
  EXPECT_EQ(report.defects[Defect::kDoubledBead].count, 4u);
  EXPECT_EQ(found(replay(kHeat + square(0.2) + square(0.2) + "M104 S0\n")), "doubled-bead");
  // Back along a line is how thin walls are filled.
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "G1 X10 Y50 E1\nG1 X10 Y10 E1\nM104 S0\n")), "");
}

TEST(GcodeReplay, ATravelThroughAWallIsANoteUnlessTheFilamentIsDrawnBack) {
  const std::string line = ";TYPE:Internal infill\n;WIDTH:0.4\n";
  const ReplayReport report =
      replay(kHeat + square(0.2) + "G0 X15 Y15\nG0 X40 Y20\n" + line + "G1 X50 Y20 E0.31585\nM104 S0\n");
  EXPECT_EQ(found(report), "wall-crossing");
  EXPECT_EQ(report.defects[Defect::kCrossing].count, 1u);
  EXPECT_EQ(report.defects.faults(), 0u);
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "G1 E-1\nG0 X40 Y20\nG1 E1\n" + line + "G1 X50 Y20 E0.31585\nM104 S0\n")), "");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "G10\nG0 X40 Y20\nG11\n" + line + "G1 X50 Y20 E0.31585\nM104 S0\n")), "");
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "G0 X20 Y20\n" + line + "G1 X25 Y20 E0.15793\nM104 S0\n")), "");  // inside
}

TEST(GcodeReplay, BeadsHaveASpeed) {
  std::string still = square(0.2);
  still.replace(still.find("F1800"), 5, "F0");
  EXPECT_EQ(replay(kHeat + still).defects[Defect::kNoFeedRate].count, 4u);
}

TEST(GcodeReplay, KlipperRefusesSectionsAboveFourNozzlesSquared) {
  std::string thick = square(0.2);
  thick.replace(thick.find("E0.6317"), 7, "E6.317");
  EXPECT_EQ(found(replay(kHeat + thick + "M104 S0\n")), "thick-bead");
}

TEST(GcodeReplay, TheMachineHasLimits) {
  Extruder machine;  // 220 x 220 x 250 mm
  machine.max_nozzle_degc = 260;
  machine.max_bed_degc = 100;
  machine.material.max_melt_mm3_s = 2;
  machine.speed.travel_mm_s = 150;
  const ReplayOptions options{&machine, 0};
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "M104 S0\n", options)), "melt-rate");  // 2.28 mm3/s
  machine.material.max_melt_mm3_s = 2.3;
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "M104 S0\n", options)), "");
  EXPECT_EQ(found(replay("M140 S110\n" + (kHeat + square(0.2)) + "M104 S0\n", options)), "bed-temperature");
  EXPECT_EQ(found(replay("M104 S300\n" + (kHeat + square(0.2)) + "M104 S0\n", options)), "nozzle-temperature");
  machine.bed.corner_mm = {-110, -110};
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "M104 S0\n", options)), "");
  machine.bed.corner_mm = {15, 0};
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "M104 S0\n", options)), "off-bed");
  machine.bed.corner_mm = {0, 0};
  machine.speed.travel_mm_s = 100;
  EXPECT_EQ(found(replay(kHeat + square(0.2) + "M104 S0\n", options)), "too-fast");
  machine.speed.travel_mm_s = 150;
  machine.bed.build_height_mm = 0.3;
  EXPECT_EQ(found(replay(kHeat + square(0.2) + square(0.4) + "M104 S0\n", options)), "too-high");
}

TEST(GcodeReplay, TextThatIsNoMoveEndsIt) {
  const ReplayReport report = replay(kHeat + square(0.2) + "G1 X1,5 Y5\nM104 S0\n");
  EXPECT_EQ(report.defects[Defect::kUnreadable].count, 1u);
  EXPECT_NE(report.unreadable.find("line 17"), std::string::npos) << report.unreadable;
}

}  // namespace
}  // namespace lamina::formats::gcode
