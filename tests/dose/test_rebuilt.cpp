// Thick layers of levels stand for a surface as near to the true one as thin layers of pixels.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <cstdlib>
#include <iostream>
#include <vector>

#include "tests/dose/rebuilt.h"

namespace lamina::test {
namespace {

std::vector<RebuiltShape> rebuilt_shapes(std::uint32_t points) {
  std::vector<RebuiltShape> shapes;
  shapes.push_back(rebuilt_sphere(points));
  shapes.push_back(rebuilt_wedge("wedge of 3 degrees", 3, points));
  shapes.push_back(rebuilt_wedge("wedge of 5 degrees", 5, points));
  shapes.push_back(rebuilt_wedge("wedge of 10 degrees", 10, points));
  shapes.push_back(rebuilt_wedge("wedge of 20 degrees", 20, points));
  return shapes;
}

TEST(Rebuilt, LayersOf300MicrometresInSixteenLevelsAreAsNearAsThoseOf50InPixels) {
  for (const RebuiltShape& shape : rebuilt_shapes(400)) {
    const auto rms = [&](const DropWay& way) {
      const SurfaceDistance found = distance_of_filled(DropStack(shape.part, way, shape.bed_mm, shape.height_mm), shape.points);
      EXPECT_EQ(found.lost, 0u) << shape.name;
      return found.rms_mm;
    };
    const double levels = rms({300, 300'000, 16}), thin = rms({300, 50'000}), thick = rms({300, 300'000});
    EXPECT_LE(levels, thin) << shape.name;
    EXPECT_LT(levels, thick / 2) << shape.name;
  }
}

// What solid and half a voxel of it give: the ball of a full block, and the face of one that is half full.
TEST(Rebuilt, FollowsItsTwoRulesByHand) {
  RebuiltShape wedge = rebuilt_wedge("wedge", 20, 1);
  const DropStack stack(wedge.part, {254, 100'000, 4}, wedge.bed_mm, wedge.height_mm);
  EXPECT_NEAR(stack.blurred({3, 1.5, 0.45}), 1.223, 0.002);  // in the middle of a layer: 3 / sqrt(2 pi) (1 + 2 exp(-4.5))
  EXPECT_NEAR(stack.blurred({3, 1.5, 0.5}), 0.777, 0.002);   // between two: 6 / sqrt(2 pi) exp(-1.125)
  EXPECT_TRUE(stack.filled({3, 1.5, 0.5}));
  EXPECT_FALSE(stack.filled({0.3, 1.5, 0.2}));
  // The slope begins at x 0.513 with a height of 0.45: voxel 6 from 0.6 on is 0.4998 mm high in its middle, level 3 of 3.
  EXPECT_TRUE(stack.filled({0.65, 1.5, 0.499}));
  EXPECT_FALSE(stack.filled({0.65, 1.5, 0.501}));
  // Voxel 7 is 0.536 mm high in its middle: level 1 of 3 above 0.5.
  EXPECT_TRUE(stack.filled({0.75, 1.5, 0.533}));
  EXPECT_FALSE(stack.filled({0.75, 1.5, 0.534}));
}

// The table of bench/rebuilt.md: bench/rebuilt.py sets the variable.
TEST(Rebuilt, Table) {
  if (std::getenv("LAMINA_REBUILT") == nullptr) GTEST_SKIP() << "LAMINA_REBUILT is not set: the table was NOT made";
  const DropWay paths[] = {{300, 300'000, 0}, {300, 100'000, 0},  {300, 50'000, 0},         {300, 300'000, 2},
                           {300, 300'000, 4}, {300, 300'000, 16}, {300, 300'000, 16, true}, {600, 300'000, 0},
                           {600, 50'000, 0},  {600, 300'000, 4},  {600, 300'000, 16},       {600, 300'000, 16, true}};
  for (const RebuiltShape& shape : rebuilt_shapes(1500)) {
    for (const DropWay& way : paths) {
      const DropStack stack(shape.part, way, shape.bed_mm, shape.height_mm);
      const SurfaceDistance filled = distance_of_filled(stack, shape.points),
                            blurred = distance_of_blurred(stack, shape.points);
      std::cout << fmt::format("row\t{}\t{}\t{}\t{}\t{}\t{:.1f}\t{}\t{:.1f}\t{}\n", shape.name, way.dpi, way.thickness / 1000,
                               way.levels, way.dithered ? "dithered" : "", 1000 * filled.rms_mm, filled.lost,
                               1000 * blurred.rms_mm, blurred.lost);
    }
  }
}

}  // namespace
}  // namespace lamina::test
