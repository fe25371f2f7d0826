// tests/formats/test_gcode_arcs.cpp: arcs of G-code against the circles that they were made of.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <string>
#include <vector>

#include "tests/formats/gcode_text.h"

namespace lamina {
namespace {

using test::Directory;
using test::gcode_file;
using test::kPi;

/// A circle's piece, and how it is written.
struct PlantedArc {
  double radius, start, sweep;  // mm, radians; sweep < 0: clockwise, G2
  bool by_radius, relative, inches;
  double rise = 0.25;  // mm

  std::complex<double> at(double angle) const { return std::complex<double>(100, 90) + std::polar(radius, angle); }
  /// A bead from elsewhere to the start of the arc, and the arc.
  std::string text() const {
    const double unit = inches ? 25.4 : 1;
    const std::complex<double> from = at(start), to = at(start + sweep), centre(100, 90);
    const std::complex<double> words = (relative ? to - from : to) / unit, offset = (centre - from) / unit;
    std::string text = inches ? "G20\nM83\n" : "G21\nM83\n";
    text += fmt::format("G1 X{:.12f} Y{:.12f} Z{:.12f}\n{}", from.real() / unit, from.imag() / unit, 0.2 / unit,
                        relative ? "G91\n" : "G90\n");
    text += fmt::format("{} X{:.12f} Y{:.12f} Z{:.12f} ", sweep < 0 ? "G2" : "G3", words.real(), words.imag(),
                        (relative ? rise : 0.2 + rise) / unit);
    text += by_radius ? fmt::format("R{:.12f}", (std::abs(sweep) > kPi ? -radius : radius) / unit)
                      : fmt::format("I{:.12f} J{:.12f}", offset.real(), offset.imag());
    return text + fmt::format(" E{:.12f}\n", test::filament_for(radius * std::abs(sweep), 0.45, 0.25) / unit);
  }
};

std::complex<double> complex_mm(Point2 p) { return {mm(p.x), mm(p.y)}; }

/// Ends on the circle, middles within 5 um of it, all of the sweep in its direction, and no more chords than that takes.
void expect_on_circle(const PlantedArc& arc, const formats::GcodeLayer& layer) {
  const std::complex<double> centre(100, 90);
  ASSERT_GE(layer.beads.size(), 1u);
  EXPECT_LE(std::abs(complex_mm(layer.beads.front().from) - arc.at(arc.start)), 2e-6);
  EXPECT_LE(std::abs(complex_mm(layer.beads.back().to) - arc.at(arc.start + arc.sweep)), 2e-6);
  // R of half a circle gives the centre to the root of its last digit.
  const double slack = arc.by_radius && std::abs(std::abs(arc.sweep) - kPi) < 0.1 ? 3e-4 : 0;
  double turned = 0, end_off = 0, middle_off = 0;
  bool joined = true, forward = true;
  for (std::size_t i = 0; i < layer.beads.size(); ++i) {
    const auto from = complex_mm(layer.beads[i].from) - centre, to = complex_mm(layer.beads[i].to) - centre;
    joined = joined && (i == 0 || layer.beads[i].from == layer.beads[i - 1].to);
    end_off = std::max(end_off, std::abs(std::abs(to) - arc.radius));
    middle_off = std::max(middle_off, std::abs(std::abs(from + to) / 2 - arc.radius));
    const double step = std::arg(to / from);
    forward = forward && step * arc.sweep > 0;
    turned += step;
  }
  EXPECT_TRUE(joined && forward);
  EXPECT_LE(end_off, 2e-6 + slack);
  EXPECT_LE(middle_off, 0.005 + slack);
  EXPECT_NEAR(turned, arc.sweep, (1e-5 + slack) / arc.radius + 1e-9);
  const double widest = 2 * std::acos(std::max(0.0, 1 - 0.005 / arc.radius));
  EXPECT_LE(static_cast<double>(layer.beads.size()), std::abs(arc.sweep) / std::min(widest, kPi / 2) * 1.01 + 2);
}

TEST(GcodeArcs, ChordsOfPlantedCirclesDeviateByFiveMicrometresNoMoreThan) {
  const Directory directory;
  std::size_t checked = 0;
  for (const double radius : {0.05, 5.0, 37.5, 900.0}) {
    for (const double turn : {0.02, 0.5, 0.77, 0.999, 1.0}) {
      for (int way = 0; way < 16; ++way) {
        const bool by_radius = way & 1;
        if (by_radius && turn == 1) continue;  // R defines no full circle
        const PlantedArc arc{radius, 0.3 + way, (way & 2 ? -2 : 2) * kPi * turn, by_radius, (way & 4) != 0, (way & 8) != 0};
        const auto file = gcode_file(directory, arc.text());
        ASSERT_TRUE(file) << file.error().message;
        ASSERT_EQ(file->count(), 1u) << arc.text();
        EXPECT_TRUE(file->notes().empty()) << file->notes().front() << '\n' << arc.text();
        const auto layer = file->layer(0);
        ASSERT_TRUE(layer) << layer.error().message;
        expect_on_circle(arc, *layer);
        if (HasFailure()) FAIL() << arc.text();
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, 4u * (4 * 16 + 8));
}

TEST(GcodeArcs, FilamentAndHeightAreSharedEvenlyAmongChords) {
  const Directory directory;
  // A full circle of radius 10 whose bead is 0.45 wide and 0.2 high, and half of it again to the other side.
  const double fed = test::filament_for(20 * kPi, 0.45, 0.2);
  const auto file = gcode_file(
      directory, fmt::format("M82\nG1 X60 Y50 Z0.2 F600\nG3 I-10 E{0:.9f}\nG92 E0\nG2 X40 I-10 E{1:.9f}\n", fed, fed / 2));
  ASSERT_TRUE(file) << file.error().message;
  const auto layer = file->layer(0);
  ASSERT_TRUE(layer);
  double length = 0;
  for (const formats::GcodeBead& bead : layer->beads) {
    EXPECT_EQ(bead.width, 450'000);
    length += std::abs(complex_mm(bead.to) - complex_mm(bead.from));
  }
  EXPECT_NEAR(length, 30 * kPi, 0.02);
  EXPECT_EQ(layer->beads.back().to, (Point2{40'000'000, 50'000'000}));
}

/// 10^zeros: firmwares have no exponents.
std::string power(std::size_t zeros) { return "1" + std::string(zeros, '0'); }

TEST(GcodeArcs, BadArcsGoAsInMarlinWithAWord) {
  const Directory directory;
  const std::string before = "M83\nG1 X10 Y10 Z0.2\n", after = "G1 X10 Y30 E1\n";
  struct Case {
    std::string arc, note;
    std::size_t chords;  // 0: left out, the bead behind it begins where the arc would
  };
  for (const Case& it : {Case{"G2 X20 Y10 E1\n", "line 3: an arc without a centre", 0},
                         {"G2 X20 Y10 I0 J0 E1\n", "line 3: an arc without a centre", 0},
                         {"G3 X10 Y10 R5 E1\n", "line 3: an arc without a centre", 0},
                         {"G3 X20 Y10 R0 I5 E1\n", "line 3: an arc without a centre", 0},
                         {"G3 X20 Y10 R" + power(300) + " E1\n", "line 3: an arc without a centre", 0},
                         {"G3 X15 Y10 I-5 E1\nG2 X2\n", "line 3 and 1 more: an arc without a centre", 0},
                         {"G2 X20 Y10 R3 E1\n", "line 3: an arc whose R does not reach its end", 36},
                         {"G3 X20 Y11 I5 E1\n", "line 3: an arc that ends off its circle", 37},
                         {"G3 X20 Y10 R" + power(30) + " E1\n", "", 1},
                         {"G2 X20 Y10 I5 J-" + power(30) + " E1\n", "", 1}}) {
    const auto file = gcode_file(directory, before + it.arc + after);
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_EQ(file->notes().size(), it.note.empty() ? 0u : 1u) << it.arc;
    if (!it.note.empty()) {
      EXPECT_EQ(file->notes()[0].find(it.note), 0u) << file->notes()[0];
    }
    const auto layer = file->layer(0);
    ASSERT_TRUE(layer);
    ASSERT_NEAR(static_cast<double>(layer->beads.size()), static_cast<double>(it.chords + 1), 1) << it.arc;
    EXPECT_EQ(layer->beads.size() == 1, it.chords == 0) << it.arc;
    const Point2 start{10'000'000, 10'000'000}, end{20'000'000, it.arc.find("Y11") < 9 ? 11'000'000 : 10'000'000};
    EXPECT_EQ(layer->beads.front().from, start);
    if (it.chords > 0) {
      EXPECT_EQ(layer->beads[layer->beads.size() - 2].to, end) << it.arc;
    }
    EXPECT_EQ(layer->beads.back().to, (Point2{10'000'000, 30'000'000}));
  }
}

TEST(GcodeArcs, TravelsMayBeArcsOfAnyKind) {
  const Directory directory;
  // BambuStudio lifts along one; an arc of another plane ends where it says, regardless of its direction.
  const auto file =
      gcode_file(directory, "M83\nG1 X10 Y10 Z0.2\nG2 Z0.6 I1.2 J0 P1 F600\nG18\nG3 X20 Z5 I5 K0\nG17\nG0 Z0.2\nG1 Y20 E1\n");
  ASSERT_TRUE(file) << file.error().message;
  const auto layer = file->layer(0);
  ASSERT_EQ(layer->beads.size(), 1u);
  EXPECT_EQ(layer->beads[0].from, (Point2{20'000'000, 10'000'000}));
  EXPECT_TRUE(file->notes().empty());
}

TEST(GcodeArcs, WhatNoBedHoldsIsRefusedWithinNoTimeAndMemory) {
  const Directory directory;
  const std::vector<std::pair<std::string, std::string>> files = {
      {"M83\nG18\nG2 X20 I5 E1\n", "line 3: an arc in the plane of G18"},
      {"M83\nG2 X20 I5 P3 E1\n", "line 2: an arc of several turns"},
      {"M83\nG1 Z" + power(30) + "\nG1 X1 Y1 Z1 E1\n", "line 3: a bead at 1e+30 mm"},
      {"M83\nG90.1\nG2 X20 I5 E1\n", "line 2: G90.1"},
      {"M83\nG5 X20 I5 J1 P1 Q1 E1\n", "line 2: splines"},
      {"M83\nG2 X20 Inan E1\n", "line 2: 'nan' is not a number"},
      {"M83\nG2 X20 R" + power(309) + " E1\n", "line 2: '" + power(19) + "' is not a number"},
      {"M83\nG2 X20 J" + power(30) + " E1\n", "line 2: a bead at"},  // the long way round
      {"M83\nG2 X20 J" + power(30) + " R-1000000000 E1\n", "line 2: a bead at"},
      {"M83\nG2 X20 I" + power(100) + " E1\n", "line 2: a bead at"},
      {"M83\nG2 X20 I1000000 J1000000 E1\n", "line 2: a bead at"},
  };
  for (const auto& [text, reported] : files) {
    const auto file = gcode_file(directory, text);
    ASSERT_FALSE(file) << reported;
    EXPECT_EQ(file.error().fault, Fault::kUsage);
    EXPECT_NE(file.error().message.find(reported), std::string::npos) << file.error().message;
  }
  // A line of a dozen bytes is up to a few thousand chords: layers have a bound, which is checked before memory is taken.
  std::string many = "M83\n";
  for (int i = 0; i < 30; ++i) many += "G3 I1000 E1\n";
  const auto bounded = gcode_file(directory, many, {.max_beads = 20'000});
  ASSERT_FALSE(bounded);
  EXPECT_NE(bounded.error().message.find("a layer of more than 20000 beads"), std::string::npos) << bounded.error().message;
  EXPECT_TRUE(gcode_file(directory, many));
}

}  // namespace
}  // namespace lamina
