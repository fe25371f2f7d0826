// tests/infill/test_skirt.cpp: where the beads before the first one lie.
#include <gtest/gtest.h>

#include <array>

#include "stages/infill/skirt.h"

namespace lamina::test {
namespace {

constexpr Nm kWidth = 450'000;
constexpr std::array<std::int64_t, 2> kBed{220'000'000, 200'000'000};

Box box_at(double x0, double y0, double x1, double y1) {
  Box box;
  box.add(Point3{static_cast<Nm>(nm_of(x0)), static_cast<Nm>(nm_of(y0)), 0});
  box.add(Point3{static_cast<Nm>(nm_of(x1)), static_cast<Nm>(nm_of(y1)), 1'000'000});
  return box;
}

/// The bead keeps within the bed, and a millimetre or `apart` from the box.
void expect_free(const Contours& skirt, const Box& box, std::int64_t apart) {
  for (std::uint32_t c = 0; c < skirt.size(); ++c) {
    for (std::size_t i = 0; i + 1 < skirt[c].size(); ++i) {
      const Point2 a = skirt[c][i], b = skirt[c][i + 1];
      EXPECT_TRUE(a.x == b.x || a.y == b.y);
      const std::int64_t x0 = std::min(a.x, b.x) - kWidth / 2, x1 = std::int64_t{std::max(a.x, b.x)} + kWidth / 2;
      const std::int64_t y0 = std::min(a.y, b.y) - kWidth / 2, y1 = std::int64_t{std::max(a.y, b.y)} + kWidth / 2;
      EXPECT_TRUE(x0 >= 0 && y0 >= 0 && x1 <= kBed[0] && y1 <= kBed[1]);
      EXPECT_TRUE(x1 <= box.lo.x - apart || x0 >= box.hi.x + apart || y1 <= box.lo.y - apart || y0 >= box.hi.y + apart);
    }
  }
}

TEST(Skirt, IsALoopAtItsDistanceAndMoreUntilItIsLongEnough) {
  const Box box = box_at(80, 80, 120, 110);
  const Contours one = infill::skirt_around(box, {1, 5, 100}, kWidth, kBed);
  ASSERT_EQ(one.size(), 1u);
  ASSERT_EQ(one[0].size(), 5u);
  EXPECT_EQ(one[0].front(), one[0].back());
  EXPECT_EQ(one[0].front(), (Point2{80'000'000 - 5'000'000 - kWidth / 2, 80'000'000 - 5'000'000 - kWidth / 2}));
  expect_free(one, box, 5'000'000);
  const Contours three = infill::skirt_around(box, {3, 5, 0}, kWidth, kBed);
  ASSERT_EQ(three.size(), 3u);
  EXPECT_EQ(three[1].front().x - three[0].front().x, kWidth) << "outermost first";
  EXPECT_EQ(three[2].front(), one[0].front());
  // 2 (2 + 2) mm + 8 x 5.225 mm = 49.8 mm a loop.
  const Contours small = infill::skirt_around(box_at(100, 100, 102, 102), {1, 5, 100}, kWidth, kBed);
  EXPECT_EQ(small.size(), 2u);
  EXPECT_EQ(infill::skirt_around(box, {0, 5, 100}, kWidth, kBed).size(), 0u);
  EXPECT_EQ(infill::skirt_around(Box(), {1, 5, 100}, kWidth, kBed).size(), 0u);
}

TEST(Skirt, KeepsToTheBedAndClearOfTheParts) {
  const Box near = box_at(3, 50, 60, 90);
  const Contours closer = infill::skirt_around(near, {2, 5, 0}, kWidth, kBed);
  ASSERT_EQ(closer.size(), 1u) << "no room for the second";
  EXPECT_EQ(closer[0].front().x, kWidth / 2);
  expect_free(closer, near, 2'000'000);
  // At the corner of the bed: a line where there is most room, of the requested length.
  const Box corner = box_at(0, 0, 30, 20);
  const Contours line = infill::skirt_around(corner, {1, 5, 100}, kWidth, kBed);
  ASSERT_EQ(line.size(), 1u);
  ASSERT_EQ(line[0].size(), 2u);
  EXPECT_EQ(line[0][0].x, 35'000'000 + kWidth / 2);
  EXPECT_EQ(line[0][0].y, kWidth / 2);
  EXPECT_EQ(line[0][1].y - line[0][0].y, 100'000'000) << "what the lower end lacks, the upper one adds";
  expect_free(line, corner, 5'000'000);
  const Contours last = infill::skirt_around(box_at(190, 180, 220, 200), {1, 5, 100}, kWidth, kBed);
  ASSERT_EQ(last.size(), 1u);
  EXPECT_EQ(last[0][1].y, kBed[1] - kWidth / 2);
  EXPECT_EQ(last[0][1].y - last[0][0].y, 100'000'000);
  const Contours whole = infill::skirt_around(corner, {1, 5, 1000}, kWidth, kBed);
  ASSERT_EQ(whole.size(), 1u);
  EXPECT_EQ(whole[0][1].y - whole[0][0].y, kBed[1] - kWidth) << "as long as the bed";
  EXPECT_EQ(infill::skirt_around(box_at(0, 0, 219, 199), {1, 5, 100}, kWidth, kBed).size(), 0u);
  const Box wide = box_at(0.5, 0.5, 219.5, 190);
  const Contours behind = infill::skirt_around(wide, {1, 5, 100}, kWidth, kBed);
  ASSERT_EQ(behind.size(), 1u);
  expect_free(behind, wide, 5'000'000);
}

}  // namespace
}  // namespace lamina::test
