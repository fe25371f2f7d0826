// tests/infill/test_brim.cpp: loops around the first layer, and its inset.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/infill/brim.h"
#include "tests/infill/outlines.h"

namespace lamina::test {
namespace {

constexpr infill::BrimSettings kBrimSettings{5 * kMm, 400'000, 357'080};
constexpr std::array<std::int64_t, 2> kBrimBed{200 * kMm, 200 * kMm};

double brim_length(const Contours& lines) {
  double sum = 0;
  for (std::uint32_t c = 0; c < lines.size(); ++c) {
    for (std::size_t i = 1; i < lines[c].size(); ++i) {
      const Point2 a = lines[c][i - 1], b = lines[c][i];
      sum += std::hypot(mm(std::int64_t{b.x} - a.x), mm(std::int64_t{b.y} - a.y));
    }
  }
  return sum;
}

// Loop k is a square of 20 mm and twice (k + 1/2) pitches: 14 of them are within 5 mm.
TEST(Brim, LoopsAreAPitchApart) {
  const Contours square = contours_of({{{50, 50}, {70, 50}, {70, 70}, {50, 70}}});
  const auto brim = infill::brim_around(square, kBrimSettings, kBrimBed);
  ASSERT_TRUE(brim.ok());
  EXPECT_EQ(brim->size(), 14u);
  double length = 0;
  for (int k = 0; k < 14; ++k) length += 4 * (20 + 2 * (k + 0.5) * 0.35708);
  EXPECT_NEAR(brim_length(*brim), length, 0.01);
  const auto outermost = (*brim)[0];
  EXPECT_NEAR(mm(std::ranges::min(outermost, {}, &Point2::x).x), 50 - 13.5 * 0.35708, 1e-5) << "the outer loop first";
  for (std::uint32_t c = 0; c < brim->size(); ++c) EXPECT_EQ((*brim)[c].front(), (*brim)[c].back());
}

TEST(Brim, HasNoLoopInHolesAndOneAroundNeighbours) {
  const Contours ring = contours_of({{{50, 50}, {70, 50}, {70, 70}, {50, 70}}, {{55, 55}, {55, 65}, {65, 65}, {65, 55}}});
  EXPECT_EQ(infill::brim_around(ring, kBrimSettings, kBrimBed)->size(), 14u);
  // 1 mm from each other: the first loop of each, and then one around both.
  const Contours two = contours_of({{{50, 50}, {60, 50}, {60, 60}, {50, 60}}, {{61, 50}, {71, 50}, {71, 60}, {61, 60}}});
  EXPECT_EQ(infill::brim_around(two, kBrimSettings, kBrimBed)->size(), 15u);
}

// Around an island 3 mm from the edge of its hole, 8 loops are half a pitch or more away from that edge.
TEST(Brim, HasLoopsAroundIslandsInHoles) {
  const Contours target = contours_of({{{50, 50}, {70, 50}, {70, 70}, {50, 70}},
                                       {{55, 55}, {55, 65}, {65, 65}, {65, 55}},
                                       {{58, 58}, {62, 58}, {62, 62}, {58, 62}}});
  const auto brim = infill::brim_around(target, kBrimSettings, kBrimBed);
  ASSERT_TRUE(brim.ok());
  EXPECT_EQ(brim->size(), 22u);
  double length = 0;
  for (std::uint32_t c = 0; c < brim->size(); ++c) {
    const auto loop = (*brim)[c];
    const Nm left = std::ranges::min(loop, {}, &Point2::x).x;
    if (left < 55 * kMm) continue;
    EXPECT_EQ(loop.front(), loop.back());
    for (std::size_t i = 1; i < loop.size(); ++i)
      length += std::hypot(mm(std::int64_t{loop[i].x} - loop[i - 1].x), mm(std::int64_t{loop[i].y} - loop[i - 1].y));
  }
  double expected = 0;
  for (int k = 0; k < 8; ++k) expected += 4 * (4 + 2 * (k + 0.5) * 0.35708);
  EXPECT_NEAR(length, expected, 0.01);
}

// 0.6 mm from one side of a hole of 22 mm: loops are open lines there, and go on for 3 mm on the others.
TEST(Brim, EndsAtTheEdgeOfAHole) {
  const Contours target = contours_of({{{50, 50}, {80, 50}, {80, 80}, {50, 80}},
                                       {{54, 54}, {54, 76}, {76, 76}, {76, 54}},
                                       {{54.6, 63}, {58.6, 63}, {58.6, 67}, {54.6, 67}}});
  const auto brim = infill::brim_around(target, {3 * kMm, 400'000, 357'080}, kBrimBed);
  ASSERT_TRUE(brim.ok());
  EXPECT_EQ(brim->size(), 16u) << "8 around the plate, 8 around the island";
  Nm right = 0;
  for (std::uint32_t c = 0; c < brim->size(); ++c) {
    const auto loop = (*brim)[c];
    if (std::ranges::min(loop, {}, &Point2::x).x < 54 * kMm) continue;
    right = std::max(right, std::ranges::max(loop, {}, &Point2::x).x);
  }
  EXPECT_NEAR(mm(right), 58.6 + 7.5 * 0.35708, 1e-5);
}

TEST(Brim, IsWithinTheBed) {
  const Contours square = contours_of({{{1, 1}, {21, 1}, {21, 21}, {1, 21}}});
  const auto brim = infill::brim_around(square, kBrimSettings, kBrimBed);
  ASSERT_TRUE(brim.ok());
  EXPECT_GT(brim->size(), 10u);
  for (const Point2 p : brim->point) {
    EXPECT_GE(p.x, 199'999);
    EXPECT_GE(p.y, 199'999);
  }
}

// The strip that the plate loses is bridged where the rib meets it.
TEST(ElephantFoot, LeavesThinRibsConnected) {
  const Contours rib = contours_of({{{0, 0}, {10, 0}, {10, 5}, {20, 5}, {20, 5.3}, {10, 5.3}, {10, 10}, {0, 10}}});
  for (const Nm inset : {100'000, 200'000, 400'000}) {
    const auto kept = infill::without_elephant_foot(rib, inset, 400'000);
    ASSERT_TRUE(kept.ok());
    EXPECT_EQ(kept->size(), 1u) << inset;
    EXPECT_EQ(std::ranges::max(kept->point, {}, &Point2::x).x, 20'000'000) << inset;
  }
}

TEST(ElephantFoot, MovesEdgesInwardsWhereABeadStays) {
  const Contours square = contours_of({{{0, 0}, {20, 0}, {20, 20}, {0, 20}}});
  const auto inset = infill::without_elephant_foot(square, 150'000, 400'000);
  ASSERT_TRUE(inset.ok());
  EXPECT_NEAR(square_mm(doubled_area(*inset)), 19.7 * 19.7, 1e-6);
  // A fin of 0.5 mm keeps its width.
  const Contours finned = contours_of({{{0, 0}, {20, 0}, {20, 20}, {10.5, 20}, {10.5, 30}, {10, 30}, {10, 20}, {0, 20}}});
  const auto kept = infill::without_elephant_foot(finned, 150'000, 400'000);
  ASSERT_TRUE(kept.ok());
  EXPECT_NEAR(square_mm(doubled_area(*kept)), 19.7 * 19.7 + 0.5 * 10.15, 0.06);
}

}  // namespace
}  // namespace lamina::test
