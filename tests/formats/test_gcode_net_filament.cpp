// tests/formats/test_gcode_net_filament.cpp: M221, and filament that is drawn back and fed again, on the spot or in moves.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::gcode_file;

constexpr double kFilamentMm2 = test::kPi / 4 * 1.75 * 1.75;  // mm3 of a mm of filament

/// mm of filament of all beads; -1 with the reason if the file is refused.
double fed_by(const std::string& text) {
  const Directory directory;
  const auto file = gcode_file(directory, ";HEIGHT:0.2\nG1 Z0.2\n" + text);
  if (!file) return ADD_FAILURE() << file.error().message, -1;
  double sum = 0;
  for (std::uint32_t n = 0; n < file->count(); ++n) {
    const auto layer = file->layer(n, true);
    for (const BeadFeed& feed : layer->feeds) sum += feed.volume_mm3 / kFilamentMm2;
  }
  EXPECT_NEAR(sum, file->fed_mm3() / kFilamentMm2, 1e-9 * (1 + sum));
  return sum;
}

TEST(GcodeNetFilament, M221IsAppliedFromItsLineOnToItsTool) {
  const std::string bead = "G1 X10 E1\nG1 X0 E1\n";
  const std::pair<std::string, double> cases[] = {
      {"M83\nM221 S95\n" + bead, 1.9},
      {"M83\n" + bead + "M221 S50\n" + bead, 3},
      {"M83\nM221 S95.5\n" + bead, 1.91},
      {"M83\nm221s50\n" + bead + "M221 S200\n" + bead + "M221 S100\n" + bead, 7},
      {"M83\nM221 S50 T1\n" + bead + "T1\n" + bead + "T0\n" + bead, 5},
      {"M83\nM221 D1 S50\nT1\n" + bead, 1},
      {"M83\nT1\nM221 S50\n" + bead + "T0\n" + bead, 3},
      {"M83\nM221\n" + bead, 2},
      {"M83\n" + bead + "M221 S0\nG1 X9 E1\n", 2},
      {"M82\nG92 E5\nM221 S50\nG1 X10 E6\nG1 X0 E8\nG92 E0\nM221 S100\nG1 X10 E1\n", 2.5},
      {"M200 D1.75\nM83\nM221 S50\nG1 X10 E2\n", 1 / kFilamentMm2},
      {";LAYER:0\nM83\nM221 S50\n" + bead + ";LAYER:1\n" + bead, 2},
  };
  for (const auto& [text, millimetres] : cases) EXPECT_NEAR(fed_by(text), millimetres, 1e-7) << text;
  const Directory directory;
  const auto refused = gcode_file(directory, "M83\nM221 S-5\nG1 X1 E1\n");
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("line 2: M221 S-5: a flow is 0 to 10000 %"), std::string::npos);
}

TEST(GcodeNetFilament, OfLinesThatAreEasilyMisread) {
  const std::pair<std::string, double> cases[] = {
      {"M83\nT2\nG1 X20 E1\nG1 E-1\nT2\nG1 X30 E2\n", 2},
      {"M83\nT20\nG1 X20 E1\nG1 E-1\nT20\nG1 X30 E2\n", 2},  // named again, a tool keeps its retraction
      {"M83\nG1 X10 E1\nF1800 X20 E1\n", 2},                 // GCODE_MOTION_MODES: F begins a move, as X does
      {"M83\nG1 X10 E1 (a(b) c)\nG1 X0 E1 (thickness (mm)) ; x\n", 2},
  };
  for (const auto& [text, millimetres] : cases) EXPECT_NEAR(fed_by(text), millimetres, 1e-9) << text;
}

TEST(GcodeNetFilament, RepRapFirmwareScalesMovesOfAxesOnly) {
  const std::string text = "M83\nM221 S50\nG1 X10 E1\nG1 E-1\nG1 X20 E3\n";
  EXPECT_NEAR(fed_by(text), 0.5 + 1.5 - 0.5, 1e-9);
  EXPECT_NEAR(fed_by(";FLAVOR:RepRap\n" + text), 0.5 + 1.5 - 1, 1e-9);
}

TEST(GcodeNetFilament, APrimeInAMoveDepositsNothing) {
  // The 80 beads of reports/J09_m221.gcode with a retraction of 5 mm while travelling: 1154 mm3 where every move that feeds counts.
  std::string text = "M83\n";
  for (int i = 0; i < 80; ++i) text += fmt::format("G1 X30 Y{} E1\nG1 X20 E-5\nG1 X10 Y{} E5\n", i, i + 1);
  EXPECT_NEAR(fed_by(text) * kFilamentMm2, 192.42, 0.005);
}

TEST(GcodeNetFilament, ABeadBeginsWhereTheRestIsFedAgain) {
  const Directory directory;
  const auto file = gcode_file(directory,
                               "M83\n;HEIGHT:0.2\nG1 Z0.2\nG1 X10 E1\nG1 X5 E-1\nG1 X10 E0.5\nG1 X20 E2\nG1 X30 E1\n"
                               "G1 E-1\nG2 X40 I5 E2\n");
  ASSERT_TRUE(file) << file.error().message;
  const auto layer = file->layer(0, true);
  ASSERT_GT(layer->beads.size(), 4u);
  EXPECT_EQ(layer->beads[1].from, (Point2{12'500'000, 0}));
  EXPECT_NEAR(layer->feeds[1].volume_mm3 / kFilamentMm2, 1.5, 1e-12);
  EXPECT_NEAR(layer->feeds[1].primed_mm3, 0, 1e-12);
  EXPECT_FALSE(layer->feeds[1].joined);
  EXPECT_TRUE(layer->feeds[2].joined);
  double arc = 0;
  for (std::size_t i = 3; i < layer->beads.size(); ++i) arc += layer->feeds[i].volume_mm3 / kFilamentMm2;
  EXPECT_NEAR(arc, 1, 1e-9);
  EXPECT_NEAR(static_cast<double>(layer->beads[3].from.x), 35e6, 2e4) << "half of the arc is passed";
  EXPECT_FALSE(layer->feeds[3].joined);
  EXPECT_TRUE(layer->feeds[4].joined);
}

TEST(GcodeNetFilament, AnotherToolDoesNotFeedWhatTheFirstDrewBack) {
  EXPECT_NEAR(fed_by("M83\nG1 X10 E1\nG1 E-10\nT1\nG1 X20 E1\nG1 E-10\nT0\nG1 E10\nG1 X30 E1\n"), 3, 1e-9);
}

TEST(GcodeNetFilament, RetractionInMovesOnTheSpotAndAbsoluteGiveTheSameVolume) {
  std::mt19937 random(34);
  const auto between = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  for (int file = 0; file < 30; ++file) {
    std::string on_spot = "M83\n", moving = "M83\n", absolute = "M82\n";
    double deposited = 0, e = 0, y = 0;
    const auto add = [&](double length, const std::string& to) {
      e += length;
      absolute += fmt::format("G1 {} E{:.5f}\n", to, e);
    };
    for (int i = 0; i < 40; ++i) {
      const double length = std::round(between(0.1, 3) * 1e5) / 1e5, back = std::round(between(0.2, 6) * 1e5) / 1e5;
      const std::string bead = fmt::format("X{} Y{:.3f}", i % 2 * 20 + 1, y += 0.4);
      on_spot += fmt::format("G1 {} E{:.5f}\n", bead, length);
      moving += fmt::format("G1 {} E{:.5f}\n", bead, length);
      add(length, bead);
      deposited += length;
      if (random() % 3 != 0) continue;
      const std::string travel = fmt::format("X{:.3f} Y{:.3f}", between(0, 50), y += 0.4);
      on_spot += fmt::format("G1 E-{0:.5f}\nG1 {1}\nG1 E{0:.5f}\n", back, travel);
      const int pieces = static_cast<int>(random() % 4) + 1;  // a wipe, each piece rounded
      for (int k = 0; k < pieces; ++k) moving += fmt::format("G1 X{:.3f} E-{:.5f}\n", between(2, 19), back / pieces);
      moving += fmt::format("G1 {} E{:.5f}\n", travel, back);
      add(-back, "X5");
      add(back, travel);
    }
    EXPECT_NEAR(fed_by(on_spot), deposited, 1e-9 * deposited);
    EXPECT_NEAR(fed_by(moving), deposited, 40 * 2e-5) << "pieces are rounded to 1e-5 mm";
    EXPECT_NEAR(fed_by(absolute), deposited, 80 * 1e-5);
  }
}

TEST(GcodeNetFilament, MovesThatFeedNothingAreNoted) {
  const Directory directory;
  const auto note_of = [&](const std::string& text) {
    const auto file = gcode_file(directory, ";HEIGHT:0.2\nG1 Z0.2\n" + text);
    if (!file) return file.error().message;
    for (const std::string& note : file->notes()) {
      if (note.find("feed nothing") != std::string::npos) return note;
    }
    return std::string();
  };
  std::mt19937 random(8);
  std::string beads, uneven, wiped = "M82\n";
  for (int i = 0; i < 80; ++i) beads += fmt::format("G1 X{} Y{} E1\n", i % 2 * 20 + 1, i);
  for (int i = 0; i < 80; ++i) uneven += fmt::format("G1 X{} Y{} E{}.{:05}\n", i % 2 * 20, i, 0, random() % 100'000);
  for (int i = 0; i < 80; ++i) wiped += fmt::format("G1 X20 Y{} E{}\nG1 X10 E{}\nG1 E{}\n", i, i + 1., i + .5, i + 1.);
  const std::string reason = "of 80 moves with E feed nothing; by ;FLAVOR:Marlin, G90 makes E absolute after M83";
  EXPECT_NE(note_of(";FLAVOR:Marlin\nM83\nG90\n" + beads).find("line 7: 79 " + reason), std::string::npos);
  EXPECT_NE(note_of(";FLAVOR:Marlin\nM83\nG90\n" + uneven).find(reason), std::string::npos);
  EXPECT_NE(note_of("M82\n" + beads).find("79 of 80 moves with E feed nothing; check M82 and M83"), std::string::npos);
  for (const std::string& text : {"M83\nG90\n" + beads, ";FLAVOR:Marlin\nG90\nM83\n" + beads, wiped})
    EXPECT_EQ(note_of(text), "");
}

}  // namespace
}  // namespace lamina
