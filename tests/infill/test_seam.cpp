// tests/infill/test_seam.cpp: where walls begin.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "stages/infill/fill.h"
#include "stages/infill/seam.h"
#include "tests/infill/outlines.h"

namespace lamina::test {
namespace {

using infill::Seam;
using infill::seam_point;

// A notch in the right side of a square, with its corner into the part at (6, 5).
const std::vector<Point2> kNotched{{0, 0},
                                   {10'000'000, 0},
                                   {10'000'000, 4'000'000},
                                   {6'000'000, 5'000'000},
                                   {10'000'000, 6'000'000},
                                   {10'000'000, 10'000'000},
                                   {0, 10'000'000}};

TEST(Seams, AreAtTheCornerThatHidesThem) {
  EXPECT_EQ(seam_point(kNotched, Seam::kContour, {}), 0u);
  EXPECT_EQ(seam_point(kNotched, Seam::kAligned, {}), 3u) << "into the part";
  EXPECT_EQ(seam_point(kNotched, Seam::kRear, {}), 5u) << "the right one of two";
  EXPECT_EQ(seam_point(kNotched, Seam::kNearest, {-1, 9'000'000}), 6u);
}

TEST(Seams, AreAtOnePointOfAContourThatBeginsAnywhere) {
  for (const Seam seam : {Seam::kAligned, Seam::kRear, Seam::kNearest}) {
    const Point2 from{3'000'000, -4'000'000}, at = kNotched[seam_point(kNotched, seam, from)];
    std::vector<Point2> turned = kNotched;
    for (std::size_t i = 0; i < kNotched.size(); ++i) {
      std::rotate(turned.begin(), turned.begin() + 1, turned.end());
      EXPECT_EQ(turned[seam_point(turned, seam, from)], at);
    }
  }
}

TEST(Seams, MoveNoWall) {
  const Contours& square = outline("square");
  infill::FillParameters parameters;
  parameters.walls = 2;
  parameters.pattern = infill::Pattern::kNone;
  const double length = length_mm(filled(square, context_of(square), parameters));
  for (const Seam seam : {Seam::kAligned, Seam::kRear, Seam::kNearest}) {
    parameters.seam = seam;
    const Toolpaths paths = filled(square, context_of(square), parameters);
    ASSERT_EQ(paths.size(), 2u);
    for (std::uint32_t p = 0; p < 2; ++p) EXPECT_TRUE(is_closed(paths, p));
    EXPECT_DOUBLE_EQ(length_mm(paths), length);
  }
}

}  // namespace
}  // namespace lamina::test
