// What layers of G-code have for cooling, displays and hosts: a minimum time, progress and objects.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>
#include <string>

#include "stages/formats/gcode/slow_layer.h"
#include "stages/formats/gcode/write_gcode.h"
#include "tests/formats/gcode_steps.h"

namespace lamina::formats::gcode {
namespace {

/// Squares of 10 mm with walls and lines, 30 mm apart.
std::vector<BeadMove> squares(int count) {
  std::vector<BeadMove> moves;
  for (int s = 0; s < count; ++s) {
    const Nm x = 30'000'000 * s;
    const Point2 corner[] = {{x, 0}, {x + 10'000'000, 0}, {x + 10'000'000, 10'000'000}, {x, 10'000'000}};
    for (int i = 0; i < 4; ++i) moves.push_back({corner[i], corner[(i + 1) % 4], PathKind::kOuter, i == 0, 400'000, 0.08, 30});
    for (Nm y = 1'000'000; y < 9'000'000; y += 2'000'000)
      moves.push_back({{x + 1'000'000, y}, {x + 9'000'000, y}, PathKind::kRaster, true, 400'000, 0.08, 60});
  }
  return moves;
}

struct LayerText {
  std::string text;
  MoveTotals totals;
};

LayerText write_layer(const Extruder& machine, const std::vector<BeadMove>& moves, const LayerSurroundings& around = {}) {
  Buffer<char> out;
  const auto writer = make_gcode_format(machine)->layer({3, 600'000, 200'000}, 10, out, around);
  for (const BeadMove& move : moves) {
    if (move.kind == PathKind::kOuter && move.jump) writer->begin_object(static_cast<std::uint32_t>(move.from.x / 30'000'000));
    writer->deposit(move);
  }
  const MoveTotals totals = writer->finish();
  return {std::string(out.begin(), out.end()), totals};
}

/// The layer's moves, timed again from its text.
double timed_again(const Extruder& machine, const std::string& text) {
  PrintTime time(machine);
  bool first = true;
  for (const test::GcodeStep& step : test::read_steps(text).steps) {
    double dx = step.x - step.x0, dy = step.y - step.y0;
    if (step.command == "G0" && first) {  // the way to the first bead is that of the file
      dx = dy = 0;
      first = false;
    }
    const double dz = step.z0 == 0 && step.z > 0 ? 0.2 + machine.retraction.lift_mm : step.z - step.z0;
    time.move({dx, dy, dz, step.fed}, step.feed / 60);
  }
  return time.halt();
}

TEST(GcodeLayerTime, IsTheMinimumUnlessAllBeadsHaveTheMinimumSpeed) {
  for (const char* flavor : {"Marlin", "Klipper"}) {
    for (const int count : {1, 2, 5, 20}) {
      const std::vector<BeadMove> moves = squares(count);
      Extruder machine;
      machine.code.flavor = flavor;
      const LayerText fast = write_layer(machine, moves);
      EXPECT_NEAR(timed_again(machine, fast.text), fast.totals.seconds, 0.002 * fast.totals.seconds);
      for (const double minimum : {0.5, 4.0, 7.0, 15.0, 60.0}) {
        machine.fan.min_layer_s = minimum;
        machine.fan.min_print_mm_s = 8;
        const LayerText slow = write_layer(machine, moves);
        EXPECT_NEAR(timed_again(machine, slow.text), slow.totals.seconds, 0.002 * slow.totals.seconds);
        EXPECT_EQ(slow.totals.volume_mm3, fast.totals.volume_mm3);
        EXPECT_EQ(slow.totals.travels, fast.totals.travels);
        if (fast.totals.seconds >= minimum) {
          EXPECT_EQ(slow.text, fast.text);
          continue;
        }
        std::set<double> beads;
        for (const test::GcodeStep& step : test::read_steps(slow.text).steps) {
          EXPECT_TRUE(step.command != "G0" || step.feed == 120 * 60);
          if (step.moves() && step.fed > 0) beads.insert(step.feed / 60);
        }
        EXPECT_GE(*beads.begin(), 8);
        if (*beads.rbegin() > 8) {
          EXPECT_GE(slow.totals.seconds, minimum);
          EXPECT_LT(slow.totals.seconds, minimum * 1.05);
        } else {
          EXPECT_LT(slow.totals.seconds, minimum * 1.05);
        }
      }
    }
  }
}

TEST(GcodeLayerTime, SegmentedLinesKeepTheirSpeed) {
  Extruder machine;
  machine.fan.min_layer_s = 8;
  LayerSurroundings around;
  around.segmented = true;
  double wall = 0;
  for (const test::GcodeStep& step : test::read_steps(write_layer(machine, squares(1), around).text).steps) {
    if (!step.moves() || step.fed <= 0) continue;
    EXPECT_TRUE(step.type != "Internal infill" || step.feed == 3600);
    if (step.type == "External perimeter") wall = step.feed;
  }
  EXPECT_LT(wall, 30 * 60 * 0.9);
}

TEST(GcodeObjects, BeginAndEndWithTheFilamentDrawnBack) {
  const std::vector<ExtrusionObject> objects = {{"a", {0, 0}, {10'000'000, 10'000'000}},
                                                {"b_2", {30'000'000, 0}, {40'000'000, 10'000'000}}};
  for (const bool klipper : {false, true}) {
    for (const double minimum : {0.0, 60.0}) {
      Extruder machine;
      machine.code.relative_extrusion = false;
      machine.code.objects = klipper ? "klipper" : "m486";
      machine.code.flavor = klipper ? "Klipper" : "Marlin";
      machine.retraction.wipe_mm = 1;
      machine.retraction.lift_mm = 0.3;
      machine.fan.min_layer_s = minimum;
      LayerSurroundings around;
      around.objects = objects;
      const std::string text = write_layer(machine, squares(2), around).text;
      std::string tags, rest = "M82\n;LAYER_CHANGE\n";
      std::istringstream lines(text);
      for (std::string line; std::getline(lines, line);) {
        const bool tag = line.rfind("M486", 0) == 0 || line.rfind("EXCLUDE", 0) == 0;
        (tag ? tags : rest) += line + "\n";
        // As at the start of the layer, which is with the filament drawn back.
        if (!tag) continue;
        EXPECT_NEAR(test::read_steps(rest).back_at_layer.back(), 0, 1e-9) << line;
      }
      EXPECT_EQ(tags, klipper ? "EXCLUDE_OBJECT_START NAME=a\nEXCLUDE_OBJECT_END NAME=a\n"
                                "EXCLUDE_OBJECT_START NAME=b_2\nEXCLUDE_OBJECT_END NAME=b_2\n"
                              : "M486 S0\nM486 S-1\nM486 S1\nM486 S-1\n");
    }
  }
  Extruder plain;
  EXPECT_EQ(write_layer(plain, squares(2)).text.find("M486"), std::string::npos);
}

TEST(GcodeObjects, AreDefinedInTheHeadAsTheFirmwareTakesThem) {
  const std::vector<ExtrusionObject> objects = {{"a", {0, 0}, {10'000'000, 20'000'000}}};
  const auto head = [&](const char* flavor, const char* tags) {
    Extruder machine;
    machine.code.flavor = flavor;
    machine.code.objects = tags;
    machine.bed.corner_mm = {-100, 0};
    Buffer<char> out;
    append_head(machine, {"lamina", "a.stl", 1, false, objects}, out);
    return std::string(out.begin(), out.end());
  };
  EXPECT_NE(head("Klipper", "klipper")
                .find("EXCLUDE_OBJECT_DEFINE NAME=a CENTER=-95.000,10.000 POLYGON=[[-100.000,0.000],"
                      "[-90.000,0.000],[-90.000,20.000],[-100.000,20.000]]\n"),
            std::string::npos);
  EXPECT_NE(head("RepRap", "m486").find("M486 T1\nM486 S0 A\"a\"\nM486 S-1\n"), std::string::npos);
  EXPECT_NE(head("Marlin", "m486").find("M486 T1\n; object 0: a\nG21"), std::string::npos);
}

TEST(GcodeProgress, IsAtTheStartOfALayer) {
  LayerSurroundings around;
  around.progress = LayerSurroundings::Progress{4, 12, 34};
  Extruder machine;
  EXPECT_NE(write_layer(machine, squares(1), around).text.find("\nM73 P12 R34\nG0"), std::string::npos);
  machine.code.flavor = "Klipper";
  EXPECT_NE(write_layer(machine, squares(1), around).text.find("\nM73 P12 R34\nSET_PRINT_STATS_INFO CURRENT_LAYER=4\nG0"),
            std::string::npos);
}

}  // namespace
}  // namespace lamina::formats::gcode
