// The cut of a layer and its moves, without a job: where the grid begins, what a machine does for each stretch.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "stages/geometry/bead_section.h"
#include "stages/segment/cut.h"
#include "stages/segment/moves.h"

namespace lamina::segment {
namespace {

constexpr Nm kMm = 1'000'000;

Box part() {
  Box box;
  box.add(Point3{3 * kMm, 5 * kMm, 0});
  box.add(Point3{23 * kMm, 15 * kMm, 2 * kMm});
  return box;
}

TEST(LayerCut, DirectionsAreExactInQuarterTurnsAndTheSameHalfATurnApart) {
  EXPECT_EQ(direction(0), (std::array<double, 2>{1, 0}));
  EXPECT_EQ(direction(kTurn / 4), (std::array<double, 2>{0, 1}));
  EXPECT_EQ(across(0), (std::array<double, 2>{-0.0, 1}));
  for (const MicroDegrees angle : {0, 12'345'678, 90'000'000, 135'000'000}) {
    EXPECT_EQ(direction(angle), direction(angle + kTurn / 2));
    const auto [x, y] = direction(angle);
    const auto [u, v] = across(angle);
    EXPECT_NEAR(x * x + y * y, 1, 1e-12);
    EXPECT_NEAR(x * u + y * v, 0, 1e-12);
  }
  EXPECT_EQ(reach(part(), direction(0)), (std::array<double, 2>{3e6, 23e6}));
  EXPECT_EQ(reach(part(), direction(kTurn / 4)), (std::array<double, 2>{5e6, 15e6}));
}

TEST(LayerCut, BeginsAtTheSideOfThePartAndIsMovedByTheShift) {
  Segmentation plan;
  CutPosition position;
  EXPECT_FALSE(layer_cut(plan, position, part()).on);
  position.on = true;
  EXPECT_EQ(layer_cut(plan, position, part()).line.origin, 3 * kMm);
  position.angle = kTurn / 4;
  EXPECT_EQ(layer_cut(plan, position, part()).line.origin, 5 * kMm);
  position.shift_mm = -0.25;
  EXPECT_EQ(layer_cut(plan, position, part()).line.origin, 5 * kMm - 250'000);
  EXPECT_EQ(layer_cut(plan, position, part()).shift, -250'000);
}

TEST(LayerCut, ThinIntervalsHaveTheirMiddlesOnTheLinesOfTheTurnedLayer) {
  Segmentation plan;
  CutPosition position;
  position.on = true;
  // Lines along x; those of the turned layer run along y, and across them is -x.
  position.first_line = -7.0 * kMm;
  EXPECT_EQ(layer_cut(plan, position, part()).line.origin, 7 * kMm - nm_of(plan.thin_mm) / 2);
}

/// A wall and three lines of 20 mm, two of them segmented.
Toolpaths paths() {
  Toolpaths made;
  for (const auto& [y, kind, line] : {std::tuple{5 * kMm, PathKind::kOuter, kNoLine},
                                      {6 * kMm, PathKind::kRaster, 0},
                                      {7 * kMm, PathKind::kRaster, 1},
                                      {8 * kMm, PathKind::kRaster, 2}}) {
    made.add({3 * kMm, y}, kind, 400'000, line);
    made.add({23 * kMm, y}, kind, 400'000, line);
    made.close();
  }
  return made;
}

TEST(Moves, AreAllThatIsDepositedWithTheSpeedAndAreaOfTheirKind) {
  Segmentation plan;
  CutPosition position;
  position.on = true;
  const LayerCut cut = layer_cut(plan, position, part());
  Extruder machine;
  const Layer layer{4, 1'000'000, 300'000};
  MoveTable table(plan, cut, machine, layer);
  DepositedSums sums;
  std::vector<BeadMove> moves;
  double length_mm = 0;
  const Toolpaths all = paths();
  const bool whole = for_each_move(all, cut, table, sums, [&](const BeadMove& move) -> std::optional<DepositedMove> {
    moves.push_back(move);
    const double length = std::hypot(mm(move.to.x - move.from.x), mm(move.to.y - move.from.y));
    length_mm += length;
    return DepositedMove{length, length * move.area_mm2};
  });
  EXPECT_TRUE(whole);
  EXPECT_NEAR(length_mm, 80, 1e-9);
  EXPECT_EQ(sums.segments.lines, 2u);
  EXPECT_EQ(sums.segments.pieces, 2u);
  EXPECT_GT(sums.segments.thin, 0u);
  EXPECT_EQ(sums.segments.intervals, 2 * sums.segments.thin + 2);  // thick at both ends
  const double full = bead_area(0.4, 0.3);
  EXPECT_EQ(moves.front().speed_mm_s, machine.speed.wall_mm_s);
  EXPECT_EQ(moves.front().width, 400'000);
  double fed = 0;
  for (const BeadMove& move : moves) {
    EXPECT_NEAR(move.area_mm2, full, 1e-12);  // 100 % extrusion everywhere
    fed += move.area_mm2 * std::hypot(mm(move.to.x - move.from.x), mm(move.to.y - move.from.y));
    if (move.kind != PathKind::kRaster) continue;
    const double share = move.speed_mm_s / machine.speed.print_mm_s * 100;
    EXPECT_TRUE(share == 100 || share == plan.thick_speed || share == plan.thin_speed) << share;
  }
  EXPECT_NEAR(sums.porosity.extruded_mm3, fed, 1e-9);

  // A first layer is deposited no faster than its limit, and a sink that stops is given nothing more.
  MoveTable first(plan, cut, machine, {0, 0, 300'000});
  std::size_t deposited = 0;
  EXPECT_FALSE(for_each_move(all, cut, first, sums, [&](const BeadMove& move) -> std::optional<DepositedMove> {
    if (move.kind == PathKind::kOuter) {
      EXPECT_EQ(move.speed_mm_s, machine.speed.first_layer_mm_s);
    }
    if (++deposited == 3) return std::nullopt;
    return DepositedMove{1, move.area_mm2};
  }));
  EXPECT_EQ(deposited, 3u);
}

/// The deposit of 1 mm of wall of 0.4 x 0.3 mm, and its stated width.
MoveTable::MoveEntry wall_of(const Extruder& machine) {
  const Segmentation plan;
  const LayerCut cut;
  MoveTable table(plan, cut, machine, {4, 1'000'000, 300'000});
  return table.of({{0, 0}, {kMm, 0}, PathKind::kOuter, Thickness::kReference, 400'000, kNoLine, true});
}

TEST(Moves, OneVolumeIsTheProfilesAreaTimesItsFlowAndTheWidthsAreThoseOfThatVolume) {
  Extruder machine;
  EXPECT_NEAR(wall_of(machine).area, 0.3 * 0.1 + std::numbers::pi / 4 * 0.09, 1e-12);
  EXPECT_EQ(wall_of(machine).width, 400'000);
  machine.material.flow = 0.9;  // of a profile without bead_area: a share of the stadium, as E always was
  EXPECT_NEAR(wall_of(machine).area, 0.9 * (0.3 * 0.1 + std::numbers::pi / 4 * 0.09), 1e-12);
  machine.material.bead_area = BeadShape::kRectangle;
  machine.material.flow = 0.85;
  EXPECT_NEAR(wall_of(machine).area, 0.102, 1e-12);
  EXPECT_EQ(wall_of(machine).width, 404'381);  // 0.102 / 0.3 + 0.3 (1 - pi / 4), where two walls measured 0.80
  machine.material.feed_ratio = 1.1;           // of the machine: it changes E, not the deposit
  EXPECT_NEAR(wall_of(machine).area, 0.102, 1e-12);
  EXPECT_NEAR(machine.material.mm3_of_e(), 1.1 * std::numbers::pi / 4 * 1.75 * 1.75, 1e-12);
  machine.material.bead_area = BeadShape::kEllipse;
  machine.material.flow = 1;
  EXPECT_NEAR(wall_of(machine).area, std::numbers::pi / 4 * 0.12, 1e-12);
  EXPECT_EQ(wall_of(machine).width, 400'000);
}

TEST(Moves, IntervalsThatAccelerationCannotFollowAreCountedWithTheSpeedThatTheyReach) {
  Extruder machine;
  machine.speed.acceleration_mm_s2 = 400;
  machine.speed.corner_mm_s = 8;
  ShortIntervals shorts;
  SpeedCounter counter(machine, shorts);
  Nm at = 0;
  const auto deposit = [&](Thickness thickness, double length, double speed) {
    const Nm to = at + static_cast<Nm>(nm_of(length));
    counter.add({{at, 0}, {to, 0}, PathKind::kRaster, thickness, 400'000, 0, false, 7}, length, speed);
    at = to;
  };
  // Half of 1.5 mm is left to speed up from 7.5 mm/s: sqrt(7.5^2 + 2 x 400 x 0.75) = 25.6 of 30 mm/s.
  for (int i = 0; i < 5; ++i) {
    deposit(Thickness::kThick, 1.5, 7.5);
    deposit(Thickness::kThin, i == 4 ? 1.7 : 1.5, 30);
  }
  deposit(Thickness::kThick, 1.5, 7.5);
  counter.end();
  EXPECT_EQ(shorts.count, 5u);
  EXPECT_NEAR(shorts.shortest_mm, 1.5, 1e-12);
  EXPECT_NEAR(shorts.reached_mm_s, std::sqrt(7.5 * 7.5 + 400 * 1.7), 1e-9);
  EXPECT_NEAR(shorts.commanded_mm_s, 30, 1e-12);
  // 2.2 mm are enough: 30^2 - 7.5^2 = 843.75 = 400 x 2.11. Corners of a curve do not divide a stretch.
  shorts = {};
  deposit(Thickness::kThick, 1.5, 7.5);
  deposit(Thickness::kThin, 1.1, 30);
  deposit(Thickness::kThin, 1.1, 30);
  deposit(Thickness::kThick, 1.5, 7.5);
  counter.end();
  EXPECT_EQ(shorts.count, 0u);
  // A line begins and ends with half of the speed of a corner; one that is not divided does not count.
  deposit(Thickness::kThin, 1, 30);
  deposit(Thickness::kThick, 1.5, 7.5);
  counter.end();
  EXPECT_EQ(shorts.count, 1u);
  EXPECT_NEAR(shorts.reached_mm_s, std::sqrt((4 * 4 + 7.5 * 7.5) / 2 + 400 * 1), 1e-9);
  deposit(Thickness::kThick, 0.01, 7.5);
  counter.end();
  EXPECT_EQ(shorts.count, 1u);
}

}  // namespace
}  // namespace lamina::segment
