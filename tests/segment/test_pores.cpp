// Pores of deposited toolpaths: which close, how long and wide they are, which cross those of the next layer.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/segment/cut.h"
#include "stages/segment/moves.h"
#include "stages/segment/segmentation.h"

namespace lamina::segment {
namespace {

constexpr Nm kNmAMm = 1'000'000;

double mean(double sum, std::uint64_t count) { return sum / static_cast<double>(count); }

/// Lines along x from 0 to 20 mm, so far apart; even ones are segmented. One end each of the others may be cut off.
Toolpaths parallel_lines(double distance_mm, int count, double cut_off_mm = 0) {
  Toolpaths paths;
  for (int n = 0; n < count; ++n) {
    const Nm y = static_cast<Nm>(nm_of(n * distance_mm)),
             to = 20 * kNmAMm - (n % 2 == 1 ? static_cast<Nm>(nm_of(cut_off_mm)) : 0);
    paths.add({0, y}, PathKind::kRaster, 400'000, n);
    paths.add({to, y}, PathKind::kRaster, 400'000, n);
    paths.close();
  }
  return paths;
}

LayerCut cut_along_x(const Segmentation& plan) {
  LayerCut cut;
  cut.on = true;
  cut.line = {plan.rule, nm_of(plan.thin_mm), nm_of(plan.thick_mm), 0, nm_of(plan.min_end_mm)};
  return cut;
}

PoreCounts pores_of(const Toolpaths& paths, const LayerCut& cut, const Segmentation& plan) {
  PoreCounts counts;
  const ToolpathsView view = paths;
  PoreCounter counter(view, cut, plan, counts);
  for_each_interval(view, cut, [&](const PathInterval& s) { counter.add(s); });
  counter.end();
  return counts;
}

// A line of 20 mm holds thin stretches of 1.5 mm at 3, 6 ... 15 mm: at 0 there is no end, and 18 to 19.5 mm is too near to one.
TEST(Pores, AreThoseThatTheDistanceOfTheLinesCloses) {
  const Segmentation plan;
  const PoreCounts pores = pores_of(parallel_lines(0.43, 7), cut_along_x(plan), plan);
  EXPECT_EQ(pores.closed, 4 * 5 * 2 - 2 * 5);  // lines 0 and 6 have a neighbour on one side only
  EXPECT_EQ(pores.edges, 2 * 5);
  EXPECT_EQ(pores.open + pores.filled, 0u);
  EXPECT_NEAR(mean(pores.length_mm, pores.closed), 1.5 - 0.45, 1e-6);
  EXPECT_NEAR(mean(pores.width_mm, pores.closed), 0.43 - (0.31 + 0.39) / 2, 1e-6);
}

TEST(Pores, BetweenLinesThatThickIntervalsDoNotReachNoneCloses) {
  const Segmentation plan;
  const PoreCounts pores = pores_of(parallel_lines(2.4, 7), cut_along_x(plan), plan);
  EXPECT_EQ(pores.closed, 0u);
  EXPECT_EQ(pores.open, 4 * 5 * 2 - 2 * 5);
  EXPECT_NEAR(mean(pores.distance_mm, pores.open), 2.4, 1e-6);
  // The last distance that bonds is a gap of 0.02 mm.
  const double last = (plan.thick_width_mm + plan.continuous_width_mm) / 2 + kBondGap;
  EXPECT_GT(pores_of(parallel_lines(last, 7), cut_along_x(plan), plan).closed, 0u);
  EXPECT_EQ(pores_of(parallel_lines(last + 0.0001, 7), cut_along_x(plan), plan).closed, 0u);
}

TEST(Pores, NeedALineNextToAllOfThemAndSpace) {
  Segmentation plan;
  // The neighbours end at 16 mm: the thin stretches from 15 to 16.5 mm have none.
  EXPECT_EQ(pores_of(parallel_lines(0.43, 7, 4), cut_along_x(plan), plan).closed, 3 * 4 * 2);
  plan.thin_mm = 0.4;
  const PoreCounts round = pores_of(parallel_lines(0.43, 7), cut_along_x(plan), plan);
  EXPECT_EQ(round.closed, 0u);
  EXPECT_GT(round.filled, 0u);
  // On the grid of Fukuda a line begins thin: no thick stretch ends its first pore.
  plan = {};
  plan.rule = CutRule::kGrid;
  const PoreCounts grid = pores_of(parallel_lines(0.43, 3), cut_along_x(plan), plan);
  EXPECT_EQ(grid.closed, 2 * 6);
  EXPECT_EQ(grid.edges, 2 * 6 + 2 * 2);
}

TEST(Pores, LieNextToClosedCurvesToo) {
  Toolpaths paths;
  for (const int n : {0, 1, 2}) {
    const Nm in = n * 430'000;
    const Nm lo = in, hi = 20 * kNmAMm - in;
    for (const Point2 p : {Point2{lo, lo}, {hi, lo}, {hi, hi}, {lo, hi}, {lo, lo}})
      paths.add(p, PathKind::kContour, 400'000, n);
    paths.close();
  }
  const Segmentation plan;
  const PoreCounts pores = pores_of(paths, cut_along_x(plan), plan);
  // Curve 0 of 80 mm has 26 periods and a neighbour inside, curve 2 of 73.12 mm has 24 and one outside.
  const std::uint64_t first = 26, third = 24;
  EXPECT_EQ(pores.closed, first + third);
  EXPECT_EQ(pores.edges, first + third);
  EXPECT_NEAR(mean(pores.width_mm, pores.closed), 0.08, 1e-6);
}

/// Lines of a square of 20 mm, 0.5 mm apart, and the middles of their thin stretches on every `period` of the lines across.
TEST(Crossing, OnlyTheThinIntervalsThatLieUnderOneAreCounted) {
  const Segmentation plan;  // 1.5 + 1.5 mm
  Toolpaths paths = parallel_lines(0.5, 41), above = paths;
  for (Point2& p : above.point) std::swap(p.x, p.y);
  LayerCut cut = cut_along_x(plan), over = cut;
  over.along_x = 0;
  over.along_y = 1;
  cut.line.origin = over.line.origin = -750'000;  // thin stretches have their middles on line 0 of the other layer
  struct Thin {
    double position, low, high;
  };
  std::vector<Thin> lower, upper;
  for_each_interval(paths, cut, [&](const PathInterval& s) {
    if (s.thickness == Thickness::kThin)
      lower.push_back({mm(s.from.y), mm(std::min(s.from.x, s.to.x)), mm(std::max(s.from.x, s.to.x))});
  });
  for_each_interval(above, over, [&](const PathInterval& s) {
    if (s.thickness == Thickness::kThin)
      upper.push_back({mm(s.from.x), mm(std::min(s.from.y, s.to.y)), mm(std::max(s.from.y, s.to.y))});
  });
  std::uint64_t meet = 0;
  for (const Thin& a : lower) {
    meet += std::ranges::any_of(upper, [&](const Thin& b) {
      return a.low <= b.position && b.position <= a.high && b.low <= a.position && a.position <= b.high;
    });
  }
  PoreCounts counts;
  count_crossed(paths, cut, above, over, counts);
  EXPECT_EQ(counts.crossing, lower.size());
  EXPECT_EQ(counts.crossed, meet);
  EXPECT_GT(meet, lower.size() / 4);
  EXPECT_LT(meet, lower.size() / 2);  // one in (thick + thin) / 1 mm, and a few more where a stretch begins at a line
  count_crossed(paths, cut, paths, cut, counts);
  EXPECT_EQ(counts.crossing, lower.size()) << "layers that are not turned do not cross";
}

}  // namespace
}  // namespace lamina::segment
