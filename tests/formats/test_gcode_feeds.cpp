// tests/formats/test_gcode_feeds.cpp: what is fed along each bead, how fast, and where lines begin anew.
#include <gtest/gtest.h>

#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::gcode_file;

constexpr double kUnit = test::kPi / 4 * 1.75 * 1.75;  // mm3 of a mm of filament

TEST(GcodeFeeds, VolumeSpeedAndCornersAreThoseOfTheCommands) {
  const Directory directory;
  const auto file = gcode_file(directory,
                               "; machine: Some Printer\nG21\nG90\nM83\n;LAYER_CHANGE\nG1 Z0.2 F600\n"
                               "G0 X0 Y0 F6000\nG1 X10 E0.5 F900\nG1 X10 Y10 E0.25\n;WIDTH:0.4\nM106 S5\nG1 X0 E0.5 F1800\n"
                               "G1 E-2 F2400\nG0 X0 Y20 F6000\nG1 E2 F2400\nG1 X10 E0.5 F600\nG92 E0\nG1 X20 E1\n"
                               "G2 X30 Y30 I0 J10 E3\nG1 X30 Y30\nG1 X30 Y40 E1\nG1 X30 Y41\nG1 X30 Y42 E1\n");
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(file->machine(), "Some Printer");
  const Result<formats::GcodeLayer> layer = file->layer(0, true);
  ASSERT_TRUE(layer.ok());
  ASSERT_EQ(layer->feeds.size(), layer->beads.size());
  ASSERT_GT(layer->feeds.size(), 9u);
  const auto expect = [&](std::size_t i, double filament, double speed, bool joined) {
    EXPECT_NEAR(layer->feeds[i].volume_mm3, filament * kUnit, 1e-9) << i;
    EXPECT_DOUBLE_EQ(layer->feeds[i].speed_mm_s, speed) << i;
    EXPECT_EQ(layer->feeds[i].joined, joined) << i;
  };
  expect(0, 0.5, 15, false);
  expect(1, 0.25, 15, true);
  expect(2, 0.5, 30, true);
  expect(3, 0.5, 10, false);
  expect(4, 1, 10, true);
  double arc = 0;
  const std::size_t last = layer->feeds.size() - 1;
  for (std::size_t i = 5; i < last - 1; ++i) {
    EXPECT_TRUE(layer->feeds[i].joined) << i;
    arc += layer->feeds[i].volume_mm3;
  }
  EXPECT_NEAR(arc, 3 * kUnit, 1e-9);
  expect(last - 1, 1, 10, true);  // a move to where the head stands is none
  expect(last, 1, 10, false);
  EXPECT_TRUE(file->layer(0)->feeds.empty());
}

TEST(GcodeFeeds, ALayerRemembersTheSpeedAndTheLineBefore) {
  const Directory directory;
  const auto file = gcode_file(directory,
                               "G21\nG90\nM83\n;LAYER_CHANGE\n;HEIGHT:0.2\nG1 Z0.2 F600\nG1 X10 E0.5 F900\n"
                               ";LAYER_CHANGE\nG1 X20 E0.5\n;LAYER_CHANGE\nG1 Z0.4\nG1 X30 E0.5\nG20\nG1 X2 F60 E1\n");
  ASSERT_TRUE(file.ok());
  EXPECT_EQ(file->machine(), "");
  const auto second = file->layer(1, true), third = file->layer(2, true);
  ASSERT_TRUE(second.ok() && third.ok());
  EXPECT_DOUBLE_EQ(second->feeds[0].speed_mm_s, 15);
  EXPECT_TRUE(second->feeds[0].joined);
  EXPECT_FALSE(third->feeds[0].joined) << "the head was lifted";
  EXPECT_DOUBLE_EQ(third->feeds[1].speed_mm_s, 25.4) << "inches";
}

TEST(GcodeFeeds, BeadsHaveTheAccelerationThatIsCommandedBeforeThem) {
  const Directory directory;
  const auto file = gcode_file(directory,
                               "G21\nG90\nM83\n;LAYER_CHANGE\n;HEIGHT:0.2\nG1 Z0.2 F600\nG1 X10 E0.5 F900\n"
                               "M204 P500 T1000\nG1 X20 E0.5\nM204 T9\nM204\nM204 S-3\nM204 printing\nG1 X30 E0.5 F1800\n"
                               ";LAYER_CHANGE\nG1 X40 E0.5\nM204 S700 ; both\nG1 X50 E0.5\n"
                               "SET_VELOCITY_LIMIT VELOCITY=9 ACCEL=800 ACCEL_TO_DECEL=400\nG1 X60 E0.5 F900\n");
  ASSERT_TRUE(file.ok()) << file.error().message;
  const auto first = file->layer(0, true), second = file->layer(1, true);
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->feeds[0].acceleration_mm_s2, 0) << "not stated yet";
  EXPECT_EQ(first->feeds[1].acceleration_mm_s2, 500);
  EXPECT_EQ(first->feeds[2].acceleration_mm_s2, 500) << "travels, nothing, and what no machine can do";
  EXPECT_EQ(second->feeds[0].acceleration_mm_s2, 500) << "a layer begins with that of the one before";
  EXPECT_EQ(second->feeds[1].acceleration_mm_s2, 700);
  EXPECT_EQ(second->feeds[2].acceleration_mm_s2, 800);
  EXPECT_EQ(file->accelerations()[0], 500);
  EXPECT_EQ(file->accelerations()[1], 800);
  EXPECT_TRUE(file->changes_speeds()) << "2 of 6 beads";
}

}  // namespace
}  // namespace lamina
