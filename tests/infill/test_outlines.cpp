// tests/infill/test_outlines.cpp: walls and regions keep their depth below the surface within the tolerance told.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "stages/geometry/clipping.h"
#include "stages/geometry/contours/simplify.h"
#include "tests/infill/outlines.h"
#include "tests/slice/contour_laws.h"

namespace lamina::test {
namespace {

using infill::FillParameters;

/// Calls act(x, y) for the corners of contours and points between them.
template <class Act>
void for_each_point(const ContoursView& contours, Act&& act) {
  constexpr int kParts = 2;
  for (std::uint32_t c = 0; c < contours.size(); ++c) {
    Point2 a = contours[c].back();
    for (const Point2 b : contours[c]) {
      for (int k = 0; k < kParts; ++k) {
        act(a.x + (static_cast<double>(b.x) - a.x) * k / kParts, a.y + (static_cast<double>(b.y) - a.y) * k / kParts);
      }
      a = b;
    }
  }
}

/// How far places of one set of contours lie from another one at most.
double furthest(const ContoursView& contours, const ContoursView& from) {
  double maximum = 0;
  for_each_point(contours, [&](double x, double y) { maximum = std::max(maximum, distance_to(from, x, y)); });
  return maximum;
}

double area_nm2(const ContoursView& contours) { return static_cast<double>(doubled_area(contours)) / 2; }

/// All that is laid below `surface`, of contours that have been simplified by nine tenths of a tolerance: as a job does.
void expect_within(const Outline& surface, Nm tolerance) {
  FillParameters parameters;
  parameters.walls = 3;
  parameters.wall_width = parameters.width = 450'000;
  parameters.gaps = {1'050'000};
  infill::FillContext context = context_of(surface.contours);
  context.tolerance = tolerance / 10;
  Contours contours = surface.contours;
  SimplifyScratch scratch;
  simplify(contours, tolerance - context.tolerance, scratch);
  const auto made = infill::outlines_of(contours, context, parameters);
  ASSERT_TRUE(made.ok());
  std::int64_t depth = 225'000;
  for (const Contours& wall : made->walls) {
    const std::string where = surface.name + ", " + std::to_string(depth) + " nm deep";
    expect_clean(wall, where);
    const auto exact = offset_contours(surface.contours, -depth);
    ASSERT_TRUE(exact.ok());
    double minimum = 1e300;
    for_each_point(wall, [&](double x, double y) { minimum = std::min(minimum, distance_to(surface.contours, x, y)); });
    const double slack = static_cast<double>(tolerance) + 5;
    EXPECT_GE(minimum, static_cast<double>(depth) - slack) << where;
    EXPECT_LE(furthest(wall, *exact), slack) << where;
    EXPECT_LE(std::abs(area_nm2(wall) - area_nm2(*exact)), slack * perimeter(*exact)) << where;
    depth += 450'000;
  }
}

TEST(Outlines, NoWallIsFurtherFromTheTrueOffsetOfTheTrueSurfaceThanTheToleranceReported) {
  for (const char* name : {"square", "touching holes", "islands in holes", "nist", "crown", "knot", "nut"}) {
    expect_within({name, outline(name)}, 10'000);
    expect_within({name, outline(name)}, 0);
  }
}

/// A polygon of so many corners around a point.
Contours round(Point2 centre, double radius, int corners) {
  Contours out;
  for (int k = 0; k < corners; ++k) {
    const double turn = 2 * std::numbers::pi * k / corners;
    out.point.push_back({static_cast<Nm>(centre.x + std::lround(radius * std::cos(turn))),
                         static_cast<Nm>(centre.y + std::lround(radius * std::sin(turn)))});
  }
  out.close();
  return out;
}

TEST(MergeShortEdges, HalvesAFineArcWithinTheTolerance) {
  const Contours fine = round({3 * kMm, -2 * kMm}, 200'000, 40);  // edges of 31 um that turn by 9 degrees
  Contours merged = fine;
  MergeScratch scratch;
  merge_short_edges(merged, 50'000, 2'000, scratch);
  EXPECT_LE(merged.point.size(), 22u);
  EXPECT_LE(furthest(merged, fine), 2'000);
  EXPECT_LE(furthest(fine, merged), 2'000);
  EXPECT_NEAR(area_nm2(merged) / area_nm2(fine), 1, 0.01);
  expect_clean(merged, "merged");
  for (const auto& [shortest, tolerance] : {std::pair<Nm, Nm>{50'000, 0}, {30'000, 2'000}, {50'000, 300}}) {
    Contours kept = fine;
    merge_short_edges(kept, shortest, tolerance, scratch);
    EXPECT_TRUE(kept.point == fine.point) << shortest << " nm, tolerance " << tolerance;
  }
}

TEST(MergeShortEdges, ContoursThatWouldTouchKeepTheirPoints) {
  Contours close = round({0, 0}, 200'000, 40);
  // A triangle whose tip is 1 nm outside of the middle of an edge that moves out by half a micrometre.
  const double turn = 2 * std::numbers::pi * 8.5 / 40, at = 200'000 * std::cos(std::numbers::pi / 40);
  const auto position = [&](double radius, double by) {
    return Point2{static_cast<Nm>(std::lround(radius * std::cos(turn + by))),
                  static_cast<Nm>(std::lround(radius * std::sin(turn + by)))};
  };
  for (const Point2 p : {position(at + 100, 0), position(at + 900'000, 0.2), position(at + 900'000, -0.2)})
    close.point.push_back(p);
  if (doubled_area(std::span(close.point).subspan(40)) < 0) std::swap(close.point[41], close.point[42]);
  close.close();
  Contours merged = close;
  MergeScratch scratch;
  merge_short_edges(merged, 50'000, 2'000, scratch);
  EXPECT_TRUE(merged.point == close.point);
}

}  // namespace
}  // namespace lamina::test
