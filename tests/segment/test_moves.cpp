// The cut of a layer and its moves, without a job: where the grid begins, what a machine does for each stretch.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/segment/bead.h"
#include "stages/segment/layer_cut.h"
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
  CutPlace place;
  EXPECT_FALSE(layer_cut(plan, place, part()).on);
  place.on = true;
  EXPECT_EQ(layer_cut(plan, place, part()).line.origin, 3 * kMm);
  place.angle = kTurn / 4;
  EXPECT_EQ(layer_cut(plan, place, part()).line.origin, 5 * kMm);
  place.shift_mm = -0.25;
  EXPECT_EQ(layer_cut(plan, place, part()).line.origin, 5 * kMm - 250'000);
  EXPECT_EQ(layer_cut(plan, place, part()).shift, -250'000);
}

TEST(LayerCut, ThinStretchesHaveTheirMiddlesOnTheLinesOfTheTurnedLayer) {
  Segmentation plan;
  CutPlace place;
  place.on = true;
  // Lines along x; those of the turned layer run along y, and across them is -x.
  place.first_line = -7.0 * kMm;
  EXPECT_EQ(layer_cut(plan, place, part()).line.origin, 7 * kMm - nm_of(plan.thin_mm) / 2);
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

TEST(Moves, AreAllThatIsLaidWithTheSpeedAndAreaOfTheirKind) {
  Segmentation plan;
  CutPlace place;
  place.on = true;
  const LayerCut cut = layer_cut(plan, place, part());
  Extruder machine;
  const Layer layer{4, 1'000'000, 300'000};
  MoveTable table(plan, cut, machine, layer);
  SegmentCounts counts;
  PlannedPorosity volume;
  std::vector<BeadMove> moves;
  double length_mm = 0;
  const Toolpaths all = paths();
  const bool whole = for_each_move(all, cut, table, counts, volume, [&](const BeadMove& move) -> std::optional<double> {
    moves.push_back(move);
    const double length = std::hypot(mm(move.to.x - move.from.x), mm(move.to.y - move.from.y));
    length_mm += length;
    return length;
  });
  EXPECT_TRUE(whole);
  EXPECT_NEAR(length_mm, 80, 1e-9);
  EXPECT_EQ(counts.lines, 2u);
  EXPECT_EQ(counts.pieces, 2u);
  EXPECT_GT(counts.thin, 0u);
  EXPECT_EQ(counts.stretches, 2 * counts.thin + 2);  // thick at both ends
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
  EXPECT_NEAR(volume.extruded_mm3, fed, 1e-9);

  // A first layer is laid no faster than its limit, and a sink that stops is given nothing more.
  MoveTable first(plan, cut, machine, {0, 0, 300'000});
  std::size_t laid = 0;
  EXPECT_FALSE(for_each_move(all, cut, first, counts, volume, [&](const BeadMove& move) -> std::optional<double> {
    if (move.kind == PathKind::kOuter) {
      EXPECT_EQ(move.speed_mm_s, machine.speed.first_layer_mm_s);
    }
    if (++laid == 3) return std::nullopt;
    return 1.0;
  }));
  EXPECT_EQ(laid, 3u);
}

}  // namespace
}  // namespace lamina::segment
