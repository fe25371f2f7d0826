// Travels of G-code: retraction with wipe and lift, and travels inside of contours without it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "stages/formats/gcode/write_gcode.h"
#include "stages/geometry/travel/edge_grid.h"
#include "tests/formats/gcode_steps.h"

namespace lamina::formats::gcode {
namespace {

constexpr int kLayers = 8;

/// Two squares of 60 mm, each with a slot of 40 x 4 mm.
Contours two_frames() {
  Contours region;
  for (const Nm x : {0, 80'000'000}) {
    for (const Point2 p : {Point2{x, 0}, {x + 60'000'000, 0}, {x + 60'000'000, 60'000'000}, {x, 60'000'000}})
      region.point.push_back(p);
    region.close();
    for (const Point2 p : {Point2{x + 10'000'000, 28'000'000},
                           {x + 10'000'000, 32'000'000},
                           {x + 50'000'000, 32'000'000},
                           {x + 50'000'000, 28'000'000}})
      region.point.push_back(p);
    region.close();
  }
  return region;
}

struct TravelFile {
  std::string text;
  MoveTotals totals;
  double volume_mm3 = 0;
};

/// Short beads of one to eight lines within the frames.
TravelFile write_beads(const Extruder& machine, const Contours* region, unsigned seed) {
  TravelFile file;
  Buffer<char> out;
  append_head(machine, {"lamina test", "a.stl", kLayers, false}, out);
  std::mt19937 random(seed);
  const auto between = [&](Nm low, Nm high) { return std::uniform_int_distribution<Nm>(low, high)(random); };
  const travel::EdgeGrid grid = region != nullptr ? travel::EdgeGrid(*region) : travel::EdgeGrid();
  for (std::uint32_t n = 0; n < kLayers; ++n) {
    LayerWriter writer(machine, {n, static_cast<Nm>(n) * 200'000, 200'000}, kLayers, out, {},
                       {region != nullptr ? &grid : nullptr, 200'000});
    for (int b = 0; b < 60; ++b) {
      Point2 at{between(2'000'000, 58'000'000) + between(0, 1) * 80'000'000,
                between(0, 1) == 1 ? between(2'000'000, 25'000'000) : between(35'000'000, 58'000'000)};
      for (int lines = between(1, 8); lines > 0; --lines) {
        const Point2 to{at.x + between(-500'000, 500'000), at.y + between(-500'000, 500'000)};
        if (to == at) continue;
        file.volume_mm3 += writer.deposit({at, to, PathKind::kRaster, false, 400'000, 0.08, 40}) * 0.08;
        at = to;
      }
    }
    file.totals.add(writer.finish());
  }
  append_tail(machine, file.totals, kLayers, out);
  file.text.assign(out.begin(), out.end());
  return file;
}

Extruder travel_machine(bool relative, double length_mm) {
  Extruder machine;
  machine.code.relative_extrusion = relative;
  machine.retraction.length_mm = length_mm;
  return machine;
}

bool crosses(const Contours& region, double x0, double y0, double x1, double y1) {
  const auto turn = [](double ax, double ay, double bx, double by, double cx, double cy) {
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax);
  };
  for (std::uint32_t c = 0; c < region.size(); ++c) {
    for (std::size_t i = 0; i < region[c].size(); ++i) {
      const Point2 p = region[c][i], q = region[c][(i + 1) % region[c].size()];
      const double px = mm(p.x), py = mm(p.y), qx = mm(q.x), qy = mm(q.y);
      if (turn(x0, y0, x1, y1, px, py) * turn(x0, y0, x1, y1, qx, qy) < 0 &&
          turn(px, py, qx, qy, x0, y0) * turn(px, py, qx, qy, x1, y1) < 0)
        return true;
    }
  }
  return false;
}

TEST(GcodeTravel, TakesBackAndGivesAgainTheSameFilamentInEveryLayer) {
  const Contours region = two_frames();
  for (const bool relative : {true, false}) {
    for (const double wipe : {0.0, 0.3, 3.0}) {
      for (const double lift : {0.0, 0.4}) {
        Extruder machine = travel_machine(relative, 1.23457);
        machine.retraction.wipe_mm = wipe;
        machine.retraction.lift_mm = lift;
        machine.retraction.inside = lift > 0;
        machine.retraction.detour_mm = 50;
        const TravelFile file = write_beads(machine, &region, 7);
        const test::GcodeSteps read = test::read_steps(file.text);
        ASSERT_EQ(read.back_at_layer.size(), kLayers + 1u);
        for (const double back : read.back_at_layer) EXPECT_NEAR(back, 1.23457, 1e-9);
        double fed = 0;
        for (const test::GcodeStep& step : read.steps) {
          ASSERT_GT(step.back, -1e-9);
          ASSERT_LT(step.back, 1.23457 + 1e-9);
          if (step.fed > 0 && step.moves()) {
            ASSERT_NEAR(step.back, 0, 1e-9) << "a bead while the filament is drawn back";
            fed += step.fed;
          }
        }
        EXPECT_NEAR(fed, file.totals.filament_mm, kLayers * 1e-5);
        EXPECT_NEAR(file.totals.volume_mm3, file.volume_mm3, 1e-9);
      }
    }
  }
}

TEST(GcodeTravel, WipesBackAlongTheBeadNoFasterThanItRetracts) {
  Extruder machine = travel_machine(true, 1);
  machine.retraction.wipe_mm = 2;
  machine.retraction.speed_mm_s = 20;
  const test::GcodeSteps read = test::read_steps(write_beads(machine, nullptr, 3).text);
  double way = 0;
  int wipes = 0, whole = 0;
  std::vector<std::pair<double, double>> bead;
  for (const test::GcodeStep& step : read.steps) {
    if (step.command == "G0" || (step.fed > 0 && !step.moves())) {
      if (way > 0) {
        ++wipes;
        whole += way > 1.99;
        EXPECT_LT(way, 2.005);
        EXPECT_NEAR(step.back, step.fed > 0 ? 0 : 1, 1e-9);
      }
      way = 0;
      bead = {{step.x, step.y}};
    } else if (step.fed < 0 && step.moves()) {
      const double length = std::hypot(step.x - step.x0, step.y - step.y0);
      way += length;
      EXPECT_LE(-step.fed / length * step.feed / 60, 20 * (1 + 0.0015 / length)) << "mm/s of filament";
      const auto distance = [&](std::size_t i) {
        const auto [ax, ay] = bead[i];
        const auto [bx, by] = bead[i + 1];
        const double dx = bx - ax, dy = by - ay;
        const double share = std::clamp(((step.x - ax) * dx + (step.y - ay) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
        return std::hypot(step.x - ax - share * dx, step.y - ay - share * dy);
      };
      double nearest = 1e9;
      for (std::size_t i = 0; i + 1 < bead.size(); ++i) nearest = std::min(nearest, distance(i));
      EXPECT_LT(nearest, 0.002);
    } else if (step.moves()) {
      bead.emplace_back(step.x, step.y);
    }
  }
  EXPECT_GT(wipes, 200);
  EXPECT_GT(whole, 20);
  EXPECT_LT(whole, wipes) << "some beads are shorter than the wipe";
}

TEST(GcodeTravel, LiftsTheNozzleOverRetractedTravelsOnly) {
  Extruder machine = travel_machine(false, 1);
  machine.retraction.lift_mm = 0.5;
  int lifted = 0;
  for (const test::GcodeStep& step : test::read_steps(write_beads(machine, nullptr, 4).text).steps) {
    const double top = 0.2 * (step.layer + 1);
    if (!step.moves()) continue;
    ASSERT_NEAR(step.z, step.back > 0.5 ? top + 0.5 : top, 1e-9);
    lifted += step.z > top + 0.1;
  }
  EXPECT_GT(lifted, 300);
}

TEST(GcodeTravel, NoTravelWithoutARetractionCrossesAContour) {
  const Contours region = two_frames();
  std::vector<std::uint64_t> retractions;
  for (const double detour : {-1.0, 0.0, 60.0}) {
    Extruder machine = travel_machine(true, 1);
    machine.retraction.inside = detour >= 0;
    machine.retraction.detour_mm = std::max(detour, 0.0);
    const TravelFile file = write_beads(machine, &region, 5);
    retractions.push_back(file.totals.retractions);
    int crossing = 0, inside = 0;
    double travel = 0;
    for (const test::GcodeStep& step : test::read_steps(file.text).steps) {
      if (step.command != "G0") continue;
      const double length = std::hypot(step.x - step.x0, step.y - step.y0);
      travel += length;
      if (step.back > 0.5 || length < machine.retraction.min_travel_mm) continue;
      ++inside;
      crossing += crosses(region, step.x0, step.y0, step.x, step.y);
    }
    EXPECT_EQ(crossing, 0);
    EXPECT_EQ(inside > 50, detour >= 0);
    EXPECT_GT(travel, file.totals.travel_mm) << "the first travel of a layer is not known to it";
  }
  EXPECT_LT(retractions[1], 0.9 * static_cast<double>(retractions[0]));
  EXPECT_LT(retractions[2], 0.8 * static_cast<double>(retractions[1]));
}

TEST(GcodeFan, SpeedsUpFromItsFirstLayerToItsFullOne) {
  const auto speeds = [](std::uint32_t from, std::uint32_t full, std::optional<std::uint32_t> first) {
    Extruder machine;
    machine.fan.from_layer = from;
    machine.fan.full_layer = full;
    machine.fan.percent = 80;
    std::string found;
    for (std::uint32_t n = 0; n < kLayers; ++n) {
      Buffer<char> out;
      LayerWriter writer(machine, {n, static_cast<Nm>(n) * 200'000, 200'000}, kLayers, out, {1, first});
      const std::string text(out.begin(), out.end());
      const std::size_t at = text.find("M106 S");
      found += at == std::string::npos ? "-" : text.substr(at + 6, text.find('\n', at) - at - 6);
      found += ' ';
    }
    return found;
  };
  EXPECT_EQ(speeds(1, 0, std::nullopt), "- 204 - - - - - - ");
  EXPECT_EQ(speeds(1, 4, std::nullopt), "- 51 102 153 204 - - - ");
  EXPECT_EQ(speeds(1, 4, 3), "- - - 153 204 - - - ") << "layers of a job that begins at the third one are as in the whole job";
  EXPECT_EQ(speeds(2, 2, std::nullopt), "- - 204 - - - - - ");
}

}  // namespace
}  // namespace lamina::formats::gcode
