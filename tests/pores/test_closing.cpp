#include <gtest/gtest.h>

#include <algorithm>

#include "stages/pores/porosity.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::kEdge;
using testing::random_box;
using testing::stack_of;
using testing::turned;
using testing::Voxels;

// Fills a gap if solid voxels are before and after it, by a scan along each column.
Voxels slow_closing(const Voxels& box, bool periodic, std::uint32_t gap) {
  const auto near = [&](std::uint32_t x, std::uint32_t y, std::uint32_t z, int side) {
    for (std::uint32_t away = 1; away <= gap; ++away) {
      std::int64_t at = std::int64_t{y} + side * std::int64_t{away};
      if (periodic) at = ((at % box.ny) + box.ny) % box.ny;
      if (at < 0 || at >= box.ny) return UINT32_MAX / 4;
      if (box.at(x, static_cast<std::uint32_t>(at), z) != 0) return away;
    }
    return UINT32_MAX / 4;
  };
  return Voxels(box.nx, box.ny, box.nz).fill([&](auto x, auto y, auto z) {
    return box.at(x, y, z) != 0 || near(x, y, z, -1) + near(x, y, z, 1) - 1 <= gap;
  });
}

TEST(CloseGaps, FillsWhatLiesBetweenTwoSolidVoxels) {
  for (std::uint32_t seed = 0; seed < 300; ++seed) {
    const Voxels box = random_box(seed, 14);
    const std::uint32_t gap = seed % 9;
    const std::array<bool, 3> periodic{seed % 2 == 0, seed % 4 < 2, false};
    const Nm distance = static_cast<Nm>(gap) * 10'000 + 9'999;
    const VoxelStack along_y = close_gaps(stack_of(box, periodic, kEdge), 1, distance);
    const VoxelStack expected = stack_of(slow_closing(box, periodic[1], std::min(gap, box.ny)), periodic, kEdge);
    EXPECT_EQ(along_y.change, expected.change) << seed;
    EXPECT_EQ(along_y.row_offset, expected.row_offset) << seed;
    // Along x it is the same of the box turned by its diagonal.
    const Voxels across = turned(box, {1, 0, 2});
    const VoxelStack along_x = close_gaps(stack_of(across, {periodic[1], periodic[0], false}, kEdge), 0, distance);
    EXPECT_EQ(along_x.change, stack_of(turned(slow_closing(box, periodic[1], std::min(gap, box.ny)), {1, 0, 2})).change)
        << seed;
  }
}

// Beads along x with cusps of two voxels between every second pair: bonded, only the wide gaps are left.
TEST(CloseGaps, ReportsBothPorositiesOfBeadsThatMayBond) {
  const Voxels beads = Voxels(8, 20, 3).fill([](auto, auto y, auto) { return !(y % 20 < 4 || (y >= 10 && y < 12)); });
  const VoxelStack solid = stack_of(beads, {true, true, true}, kEdge);
  EXPECT_DOUBLE_EQ(porosity(solid).total(), 6 / 20.0);
  EXPECT_DOUBLE_EQ(porosity(close_gaps(solid, 1, 20'000)).total(), 4 / 20.0);
  EXPECT_DOUBLE_EQ(porosity(close_gaps(solid, 1, 19'999)).total(), 6 / 20.0);
  EXPECT_DOUBLE_EQ(porosity(close_gaps(solid, 1, 0)).total(), 6 / 20.0);
  EXPECT_DOUBLE_EQ(porosity(close_gaps(solid, 1, 1'000'000)).total(), 0);
}

}  // namespace
}  // namespace lamina::pores
