// tests/formats/test_gcode_spirals.cpp: layers of G-code without tags: turns, heights, given heights.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <string>

#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::filament_for;
using test::gcode_file;
using test::kPi;

struct SpiralPoint {
  double x, y;
};

/// Points at `steps` places a turn, each 1/steps of `pitch` above the one before, as FullControl writes them; a bead 0.4 mm
/// wide.
std::string spiral(double turns, int steps, double pitch, double from_z, const std::function<SpiralPoint(double)>& position) {
  std::string text = "M83\n";
  SpiralPoint last = position(0);
  text += fmt::format("G0 X{:.3f} Y{:.3f} Z{:.3f}\n", last.x, last.y, from_z);
  const int count = static_cast<int>(std::lround(turns * steps));
  for (int i = 1; i <= count; ++i) {
    const SpiralPoint at = position(2 * kPi * i / steps);
    const double fed = filament_for(std::hypot(at.x - last.x, at.y - last.y), 0.4, pitch);
    text += fmt::format("G1 X{:.3f} Y{:.3f} Z{:.4f} E{:.6f}\n", at.x, at.y, from_z + pitch * i / steps, fed);
    last = at;
  }
  return text;
}

SpiralPoint circle(double angle) { return {100 + 30 * std::cos(angle), 100 + 30 * std::sin(angle)}; }

TEST(GcodeSpirals, EachTurnIsALayerOfItsWidth) {
  const Directory directory;
  const auto wavy = [](double a) {
    const double r = 30 + 4 * std::sin(6 * a);
    return SpiralPoint{100 + r * std::cos(a), 100 + r * std::sin(a)};
  };
  const auto square = [](double a) { return SpiralPoint{100 + 20 * std::cos(a + 0.1), 90 - 20 * std::sin(a + 0.1)}; };
  const auto cone = [](double a) { return SpiralPoint{100 + (40 - a / 10) * std::cos(a), 100 + (30 - a / 10) * std::sin(a)}; };
  struct Case {
    std::function<SpiralPoint(double)> position;
    int steps;
    double pitch;
  };
  for (const Case& it : {Case{circle, 64, 0.2}, {circle, 400, 0.1}, {wavy, 300, 0.35}, {square, 4, 0.3}, {cone, 90, 0.3}}) {
    const auto file = gcode_file(directory, spiral(40, it.steps, it.pitch, 0.2, it.position));
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_NEAR(file->count(), 40, 1) << it.steps;
    ASSERT_EQ(file->notes().size(), 1u);
    EXPECT_EQ(file->notes()[0].find("beads climb in a spiral: "), 0u) << file->notes()[0];
    for (std::uint32_t k = 0; k + 1 < file->count(); ++k) {
      const auto layer = file->layer(k);
      ASSERT_TRUE(layer);
      EXPECT_NEAR(static_cast<double>(layer->beads.size()), it.steps, 0.04 * it.steps);
      EXPECT_NEAR(mm(layer->z), 0.2 + it.pitch * k, 0.3 * it.pitch);
      for (const formats::GcodeBead& bead : layer->beads) ASSERT_NEAR(mm(bead.width), 0.4, 0.025) << k;
    }
    // Nothing is lost: all beads are in some layer.
    std::size_t beads = 0;
    for (std::uint32_t k = 0; k < file->count(); ++k) beads += file->layer(k)->beads.size();
    EXPECT_EQ(beads, static_cast<std::size_t>(40 * it.steps));
  }
}

TEST(GcodeSpirals, HelicesOfArcsAreTurnsToo) {
  const Directory directory;
  for (const std::string turn : {"G3 I-10 Z0.2 E1\n", "G3 X-20 I-10 Z0.1 E.5\nG3 X20 I10 Z0.1 E.5\n"}) {
    std::string text = "G1 X50 Y50 Z0.2\nM83\nG91\n";
    for (int i = 0; i < 25; ++i) text += turn;
    const auto file = gcode_file(directory, text);
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(file->count(), 25u);
    EXPECT_EQ(file->layer(7)->z, file->layer(6)->z + 200'000);
  }
}

TEST(GcodeSpirals, AGivenHeightCutsThem) {
  const Directory directory;
  const std::string text = spiral(40, 64, 0.2, 0.2, circle);  // from z 0.2 to 8.2
  for (const double height : {0.2, 0.5, 1.0}) {
    const auto file = gcode_file(directory, text, {.layer_height_mm = height});
    ASSERT_TRUE(file) << file.error().message;
    EXPECT_EQ(file->count(), static_cast<std::uint32_t>(std::ceil(8.2 / height - 1e-9) - std::floor(0.2 / height + 1e-9)));
    EXPECT_TRUE(file->notes().empty());
    const auto layer = file->layer(3);
    ASSERT_TRUE(layer);
    for (const formats::GcodeBead& bead : layer->beads) ASSERT_NEAR(mm(bead.width), 0.4, 0.02) << "turns are 0.2 mm high";
  }
  // Of a file with tags as well, without what start code lays.
  const auto tagged = gcode_file(directory, "M83\nG1 Z5\nG1 X9 E1\n;LAYER:0\n" + text, {.layer_height_mm = 2});
  ASSERT_TRUE(tagged);
  EXPECT_EQ(tagged->count(), 5u);
  EXPECT_GT(tagged->box().lo.x, 60'000'000);
}

TEST(GcodeSpirals, FlatLayersWithinAGivenHeightKeepTheirOwn) {
  const Directory directory;
  std::string text = "M83\n";
  for (int k = 1; k <= 20; ++k) {
    text += fmt::format("G0 X0 Y0 Z{:.1f}\nG1 X50 E{:.6f}\n", 0.2 * k, filament_for(50, 0.4, 0.2));
  }
  const auto file = gcode_file(directory, text, {.layer_height_mm = 1});
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->count(), 4u);
  for (std::uint32_t k = 0; k < 4; ++k) {
    const auto layer = file->layer(k);
    ASSERT_TRUE(layer && layer->beads.size() == 5);
    for (const formats::GcodeBead& bead : layer->beads) EXPECT_EQ(bead.width, 400'000);
  }
}

TEST(GcodeSpirals, AFlatBottomIsLayersOfItsOwn) {
  const Directory directory;
  std::string text = "M83\n";
  for (const double z : {0.2, 0.4}) {
    text += fmt::format("G0 X80 Y80 Z{}\n", z);
    for (int i = 0; i < 10; ++i) text += fmt::format("G1 X{} E1\nG1 Y{} E.1\n", i % 2 == 0 ? 120 : 80, 81 + i);
  }
  const auto file = gcode_file(directory, text + spiral(10, 64, 0.2, 0.4, circle) + "G1 X100 Y100 E1\n");
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_NEAR(file->count(), 12, 1);
  EXPECT_EQ(file->layer(0)->beads.size(), 20u);
  EXPECT_EQ(file->layer(1)->beads.size(), 20u);
  EXPECT_EQ(file->layer(1)->z, 400'000);
  EXPECT_NEAR(static_cast<double>(file->layer(2)->beads.size()), 64, 2);
}

TEST(GcodeSpirals, FlatLayersThatASlopeJoinsStayFlatLayers) {
  const Directory directory;
  std::string text = "M83\nG0 X80 Y80 Z0.2\n";
  for (int k = 0; k < 30; ++k) {
    if (k > 0) text += fmt::format("G1 X80 Y80 Z{:.2f} E.1\n", 0.2 + 0.2 * k);
    for (int i = 0; i < 10; ++i) text += fmt::format("G1 X{} E1\nG1 Y{} E.1\n", i % 2 == 0 ? 120 : 82, 81 + i);
  }
  const auto file = gcode_file(directory, text);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_EQ(file->count(), 30u);
}

TEST(GcodeSpirals, AClimbWithoutTurnsIsDrawnInStepsWithAWord) {
  const Directory directory;
  std::string text = "M83\nG0 X0 Y0 Z0.2\n";
  for (int i = 0; i < 400; ++i) text += fmt::format("G1 X{} Z{:.2f} E.5\n", i % 2 == 0 ? 10 : 0, 0.2 + 0.05 * i);  // to z 20.15
  const auto file = gcode_file(directory, text);
  ASSERT_TRUE(file) << file.error().message;
  EXPECT_LE(file->count(), 6u);
  ASSERT_EQ(file->notes().size(), 1u);
  EXPECT_NE(file->notes()[0].find("climb without a turn"), std::string::npos);
}

// CuraEngine's "spiralize outer contour": tags at each turn, no widths; at the start of a turn the nozzle is hardly above the
// end of the one before.
TEST(GcodeSpirals, TaggedTurnsHaveTheirWidthsFromTheirStart) {
  const Directory directory;
  std::string text = "M83\nG0 X130 Y100 Z0.2\n";
  for (int k = 0; k < 8; ++k) {
    text += fmt::format(";LAYER:{}\n", k);
    for (int i = 1; i <= 60; ++i) {
      const SpiralPoint at = circle(2 * kPi * i / 60);
      text += fmt::format("G1 X{:.3f} Y{:.3f} Z{:.4f} E{:.6f}\n", at.x, at.y, 0.2 + 0.2 * (k + i / 60.0),
                          filament_for(2 * 30 * std::sin(kPi / 60), 0.4, 0.2));
    }
  }
  const auto file = gcode_file(directory, text);
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_EQ(file->count(), 8u);
  for (std::uint32_t k = 0; k < 8; ++k) {
    const auto layer = file->layer(k);
    ASSERT_TRUE(layer && layer->beads.size() == 60);
    for (const formats::GcodeBead& bead : layer->beads) ASSERT_NEAR(mm(bead.width), 0.4, 0.02);
  }
}

}  // namespace
}  // namespace lamina
