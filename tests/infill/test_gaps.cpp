// tests/infill/test_gaps.cpp: single beads in narrow regions: one line along their middle, with the volume of the region.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stages/geometry/bead_section.h"
#include "stages/geometry/clipping.h"
#include "stages/infill/gaps.h"
#include "tests/infill/outlines.h"

namespace lamina::test {
namespace {

using infill::GapLines;
using infill::GapWidths;

constexpr GapWidths kWidths{360'000, 90'000};

GapLines lines_of(const Contours& region, GapWidths widths = kWidths) {
  const auto lines = infill::gap_lines(region, widths);
  EXPECT_TRUE(lines.ok());
  EXPECT_LE(lines->lines.point.size(), infill::bound_gap_points(region, widths));
  EXPECT_EQ(lines->lines.point.size(), lines->gap.size());
  return *lines;
}

double length_of(const GapLines& lines, std::uint32_t line) {
  double sum = 0;
  const auto points = lines.lines[line];
  for (std::size_t i = 1; i < points.size(); ++i)
    sum += std::hypot(mm(std::int64_t{points[i].x} - points[i - 1].x), mm(std::int64_t{points[i].y} - points[i - 1].y));
  return sum;
}

/// mm2 that the lines fill.
double area_of(const GapLines& lines) {
  double sum = 0;
  for (std::uint32_t c = 0; c < lines.lines.size(); ++c) {
    for (std::uint32_t i = lines.lines.offset[c]; i + 1 < lines.lines.offset[c + 1]; ++i) {
      const Point2 a = lines.lines.point[i], b = lines.lines.point[i + 1];
      sum += std::hypot(mm(std::int64_t{b.x} - a.x), mm(std::int64_t{b.y} - a.y)) * mm(lines.gap[i]);
    }
  }
  return sum;
}

TEST(GapLines, OfAChannelIsItsMiddle) {
  for (const double width : {0.1, 0.15, 0.2, 0.25, 0.3, 0.35}) {
    const GapLines lines = lines_of(contours_of({{{0, 0}, {10, 0}, {10, width}, {0, width}}}));
    ASSERT_EQ(lines.lines.size(), 1u) << width;
    EXPECT_NEAR(length_of(lines, 0), 10 - width, 0.15) << width;
    for (const Point2 p : lines.lines.point) EXPECT_NEAR(mm(p.y), width / 2, 0.05 * width + 0.012) << width;
    for (const Nm gap : lines.gap) EXPECT_NEAR(mm(gap), width, 0.14 * width) << width;
  }
}

TEST(GapLines, OfARingIsClosed) {
  std::vector<std::array<double, 2>> outer, inner;
  for (int i = 0; i < 200; ++i) {
    const double angle = i * std::numbers::pi / 100;
    outer.push_back({10 + 5 * std::cos(angle), 10 + 5 * std::sin(angle)});
    inner.push_back({10 + 4.8 * std::cos(-angle), 10 + 4.8 * std::sin(-angle)});
  }
  const GapLines lines = lines_of(contours_of({outer, inner}));
  ASSERT_EQ(lines.lines.size(), 1u);
  EXPECT_EQ(lines.lines[0].front(), lines.lines[0].back());
  EXPECT_NEAR(length_of(lines, 0), 2 * std::numbers::pi * 4.9, 0.3);
  EXPECT_NEAR(area_of(lines), std::numbers::pi * (25 - 4.8 * 4.8), 0.3);
}

TEST(GapLines, OfAWedgeNarrowWithIt) {
  const GapLines lines = lines_of(contours_of({{{0, 0}, {20, 0}, {20, 0.35}, {0, 0.02}}}));
  ASSERT_EQ(lines.lines.size(), 1u) << "the pieces of each width are joined";
  const auto [low, high] = std::ranges::minmax(lines.gap);
  EXPECT_LT(low, 110'000);
  EXPECT_GT(high, 310'000);
  // Less what is narrower than the minimum: up to x = 4.24 mm.
  EXPECT_NEAR(area_of(lines), (0.35 + 0.09) / 2 * (20 - 4.24), 0.2);
}

TEST(GapLines, OfACrossReachAllArms) {
  const GapLines lines = lines_of(contours_of(
      {{{5, 0}, {5.2, 0}, {5.2, 5}, {10, 5}, {10, 5.2}, {5.2, 5.2}, {5.2, 10}, {5, 10}, {5, 5.2}, {0, 5.2}, {0, 5}, {5, 5}}}));
  EXPECT_NEAR(area_of(lines), 2 * 10 * 0.2 - 0.04, 0.25);
  EXPECT_LE(lines.lines.size(), 3u);
}

TEST(GapLines, LeaveWhatIsNarrowerThanTheMinimum) {
  const GapLines lines = lines_of(contours_of({{{0, 0}, {10, 0}, {10, 0.08}, {0, 0.08}}}));
  EXPECT_EQ(lines.lines.size(), 0u);
  EXPECT_NEAR(square_mm(doubled_area(lines.left)), 0.8, 1e-9);
}

TEST(NarrowPart, IsWhatNoDiscReaches) {
  // A plate with a fin of 0.2 mm.
  const Contours plate = contours_of({{{0, 0}, {10, 0}, {10, 5}, {5.2, 5}, {5.2, 9}, {5, 9}, {5, 5}, {0, 5}}});
  const auto inset = offset_contours(plate, -180'000);
  ASSERT_TRUE(inset.ok());
  const auto narrow = infill::narrow_part(plate, *inset, 180'000);
  ASSERT_TRUE(narrow.ok());
  EXPECT_NEAR(square_mm(doubled_area(*narrow)), 0.8, 0.01);
  const Contours square = contours_of({{{0, 0}, {10, 0}, {10, 10}, {0, 10}}});
  const auto none = infill::narrow_part(square, *offset_contours(square, -180'000), 180'000);
  ASSERT_TRUE(none.ok());
  EXPECT_EQ(none->size(), 0u) << "corners are sharp";
}

// Clipper fails without an edge that it takes.
TEST(GapLines, OfADegeneratePieceAreNone) {
  const Contours line = contours_of({{{0, 0}, {10, 0}, {5, 0}}}), square = contours_of({{{0, 0}, {1, 0}, {1, 1}, {0, 1}}});
  for (const auto& region : {subtract_contours(line, square), intersect_contours(line, square)}) {
    ASSERT_TRUE(region.ok());
    EXPECT_EQ(region->size(), 0u);
  }
  EXPECT_EQ(lines_of(line).lines.size(), 0u);
}

TEST(GapLines, BecomeBeadsOfTheirVolume) {
  const GapLines lines = lines_of(contours_of({{{0, 0}, {10, 0}, {10, 0.2}, {0, 0.2}}}));
  for (const double height : {0.1, 0.3}) {
    Toolpaths paths;
    infill::append_gap_lines(lines, height, BeadShape::kStadium, PathKind::kSolid, paths);
    ASSERT_EQ(paths.size(), 1u);
    double volume = 0;
    for (std::uint32_t i = 0; i + 1 < paths.point.size(); ++i) {
      const Point2 a = paths.point[i], b = paths.point[i + 1];
      volume += std::hypot(mm(std::int64_t{b.x} - a.x), mm(std::int64_t{b.y} - a.y)) *
                bead_area(mm(paths.width[i]), height, BeadShape::kStadium);
    }
    EXPECT_NEAR(volume, area_of(lines) * height, 1e-4);
  }
}

}  // namespace
}  // namespace lamina::test
