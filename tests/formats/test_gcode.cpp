// G-code read back by a reader of its own.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <sstream>
#include <string>

#include "stages/formats/gcode/write_gcode.h"
#include "stages/support/text/decimal.h"
#include "tests/segment/gcode_reader.h"

namespace lamina::formats::gcode {
namespace {

TEST(GcodeNumber, IsTheExactDecimalWithoutTrailingZeros) {
  const auto text = [](std::int64_t value) {
    char buffer[32];
    return std::string(buffer, put_fixed<3>(value, buffer));
  };
  EXPECT_EQ(text(0), "0");
  EXPECT_EQ(text(5), "0.005");
  EXPECT_EQ(text(-5), "-0.005");
  EXPECT_EQ(text(12'500), "12.5");
  EXPECT_EQ(text(-120'000), "-120");
  EXPECT_EQ(text(INT64_MIN), "-9223372036854775.808");
  for (std::uint64_t unit = 1; unit < 1'000'000'000'000'000'000; unit *= 10) {
    for (const std::uint64_t value : {unit - 1, unit, unit + 1, 7 * unit + 3}) {
      char buffer[kMaxDecimal];
      EXPECT_EQ(std::string(buffer, put_whole(value, buffer)), std::to_string(value));
    }
  }
}

TEST(Nearest, IsLlround) {
  std::mt19937_64 random(5);
  const double edges[] = {0,     0.5, 1.5, 2.5, 0.49999999999999994, 4503599627370495.5, 4503599627370496, 9007199254740994.0,
                          9.2e18};
  const auto check = [](double value) {
    EXPECT_EQ(nearest(value), std::llround(value)) << value;
    EXPECT_EQ(nearest(-value), std::llround(-value)) << value;
  };
  for (const double edge : edges) check(edge);
  for (int i = 0; i < 100'000; ++i) {
    const double value = std::ldexp(static_cast<double>(random() >> 11), static_cast<int>(random() % 60) - 50);
    check(value);
    check(std::floor(value) + 0.5);
  }
}

struct Written {
  std::string text;
  MoveTotals totals;
  std::vector<std::vector<BeadMove>> layers;
};

Written write_random(const Extruder& machine, int layers, unsigned seed) {
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  Written written;
  Buffer<char> out;
  append_head(machine, {"lamina test", "a.stl", static_cast<std::uint32_t>(layers), true}, out);
  for (int n = 0; n < layers; ++n) {
    const Layer layer{static_cast<std::uint32_t>(n), n * 300'000, 300'000};
    LayerWriter writer(machine, layer, static_cast<std::uint32_t>(layers), out);
    std::vector<BeadMove> moves;
    const auto point = [&] { return Point2{static_cast<Nm>(between(1e6, 2e8)), static_cast<Nm>(between(1e6, 2e8))}; };
    Point2 at = point();
    for (int i = 0; i < 500; ++i) {
      const bool jump = i == 0 || between(0, 1) < 0.2;
      if (jump) at = point();
      const Point2 to = between(0, 1) < 0.5 ? point() : Point2{at.x + static_cast<Nm>(between(-9e5, 9e5)), at.y};
      if (to == at) continue;
      moves.push_back({at, to, i % 3 == 0 ? PathKind::kOuter : PathKind::kRaster, jump,
                       static_cast<Nm>(300'000 + 50'000 * (i % 4)), between(0.05, 0.2), between(5, 60)});
      writer.deposit(moves.back());
      at = to;
    }
    written.totals.add(writer.finish());
    written.layers.push_back(moves);
  }
  append_tail(machine, written.totals, static_cast<std::uint32_t>(layers), out);
  written.text.assign(out.begin(), out.end());
  return written;
}

TEST(Gcode, SaysTheSameMovesAndVolumesRelativeAndAbsolute) {
  for (const bool relative : {true, false}) {
    for (const double retraction : {0.0, 1.2}) {
      Extruder machine;
      machine.name = "test";
      machine.code.relative_extrusion = relative;
      machine.retraction.length_mm = retraction;
      machine.material.flow = 0.85;  // is in the areas of the moves already
      machine.material.feed_ratio = 1.25;
      machine.bed.corner_mm = {-110, -110};
      const Written written = write_random(machine, 20, relative ? 1 : 2);
      const test::GcodeFile file = test::read_gcode(written.text);
      ASSERT_EQ(file.error, "");
      ASSERT_EQ(file.layers.size(), written.layers.size());
      const double filament_area = std::numbers::pi / 4 * 1.75 * 1.75;
      double fed = 0;
      for (std::size_t n = 0; n < file.layers.size(); ++n) {
        ASSERT_EQ(file.layers[n].beads.size(), written.layers[n].size());
        double layer_fed = 0, layer_volume = 0;
        for (std::size_t i = 0; i < written.layers[n].size(); ++i) {
          const BeadMove& move = written.layers[n][i];
          const test::GcodeBead& bead = file.layers[n].beads[i];
          ASSERT_NEAR(bead.x0, mm(move.from.x) - 110, 0.00051);
          ASSERT_NEAR(bead.y0, mm(move.from.y) - 110, 0.00051);
          ASSERT_NEAR(bead.x1, mm(move.to.x) - 110, 0.00051);
          ASSERT_NEAR(bead.y1, mm(move.to.y) - 110, 0.00051);
          ASSERT_NEAR(bead.feed, move.speed_mm_s * 60, 0.51);
          ASSERT_NEAR(bead.width, mm(move.width), 1e-9);
          const double length = std::hypot(mm(move.to.x) - mm(move.from.x), mm(move.to.y) - mm(move.from.y));
          layer_volume += length * move.area_mm2;
          layer_fed += bead.filament;
          // No drift: however many moves were written, what was fed so far is right to the last decimal.
          ASSERT_NEAR(layer_fed, layer_volume / (1.25 * filament_area), 0.51e-5 + 1e-9);
        }
        fed += layer_fed;
      }
      EXPECT_NEAR(fed, written.totals.filament_mm, 20 * 0.51e-5);
      EXPECT_NEAR(file.drawn_back, retraction, 1e-9);  // as it began: drawn back once
      EXPECT_EQ(file.widest_retraction > 0, retraction > 0);
      EXPECT_GT(written.totals.seconds, 0);
      EXPECT_NE(written.text.find("; filament used [mm] = "), std::string::npos);
      EXPECT_NE(written.text.find("; estimated printing time (normal mode) = "), std::string::npos);
    }
  }
}

TEST(Gcode, TimeOfOneLongMoveIsDistanceOverSpeedAndOfManyCornersIsMore) {
  EXPECT_EQ(time_text(59), "59s");
  EXPECT_EQ(time_text(3600 + 62), "1h 1m 2s");
  EXPECT_EQ(time_text(86'400 * 2), "2d 0h 0m 0s");
  Extruder machine;
  machine.retraction.length_mm = 0;
  Buffer<char> out;
  LayerWriter straight(machine, {0, 0, 300'000}, 1, out);
  straight.deposit({{0, 0}, {100'000'000, 0}, PathKind::kRaster, true, 400'000, 0.1, 50});
  EXPECT_NEAR(straight.finish().seconds, 2, 0.1);
  LayerWriter zigzag(machine, {0, 0, 300'000}, 1, out);
  for (int i = 0; i < 100; ++i) {
    zigzag.deposit({{i % 2 * 1'000'000, 0}, {(i + 1) % 2 * 1'000'000, 0}, PathKind::kRaster, i == 0, 400'000, 0.1, 50});
  }
  EXPECT_GT(zigzag.finish().seconds, 4);
}

// PrusaSlicer's viewer takes widths from the tag of Simplify3D, and only if the file names that program.
TEST(Gcode, EveryWidthIsReportedInBothTagsAndTheHeadSaysHow) {
  const Written written = write_random(Extruder(), 3, 7);
  std::istringstream lines(written.text);
  std::string line, width;
  int reported = 0;
  bool named = false;
  while (std::getline(lines, line)) {
    if (line.starts_with(';') && line.find("G-Code generated by Simplify3D(R)") != std::string::npos) named = reported == 0;
    if (line.starts_with("; tool H")) {
      EXPECT_EQ(line.substr(line.find(" W") + 2), width);
      width.clear();
      ++reported;
    } else {
      EXPECT_EQ(width, "") << "a width without its second tag";
    }
    if (line.starts_with(";WIDTH:")) width = line.substr(7);
  }
  EXPECT_TRUE(named);
  EXPECT_GT(reported, 10);
}

TEST(Gcode, AStatedAccelerationIsCommandedAsTheFirmwareTakesIt) {
  Extruder machine;
  machine.speed.acceleration_mm_s2 = 500;
  EXPECT_EQ(write_random(machine, 1, 3).text.find("M204"), std::string::npos) << "nothing states it";
  machine.speed.states_acceleration = true;
  for (const auto& [flavor, code] : {std::pair{"Marlin", "\nM204 P500 T500\n"},
                                     {"RepRap", "\nM204 P500 T500\n"},
                                     {"Klipper", "\nM204 S500\n"},
                                     {"Repetier", "\nM201 X500 Y500\nM202 X500 Y500\n"}}) {
    machine.code.flavor = flavor;
    const std::string text = write_random(machine, 1, 3).text;
    EXPECT_NE(text.find(code), std::string::npos) << flavor;
    EXPECT_LT(text.find(code), text.find(";LAYER_CHANGE")) << flavor;
  }
}

}  // namespace
}  // namespace lamina::formats::gcode
