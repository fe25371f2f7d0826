#include <gtest/gtest.h>

#include "stages/pores/rows.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::kEdge;
using testing::stack_of;
using testing::Voxels;

TEST(Coarser, IsTheMajorityOfEachBlockAndItsFirstVoxelWhereHalfIsSet) {
  for (std::uint32_t seed = 1; seed <= 60; ++seed) {
    const Voxels box = testing::random_box(seed, 9);
    const std::array<std::uint32_t, 3> f{1 + seed % 3, 1 + seed / 3 % 3, 1 + seed / 9 % 2};
    const VoxelStack got = coarser(stack_of(box, {true, false, false}, kEdge), f);
    if (box.nx < f[0] || box.ny < f[1] || box.nz < f[2]) continue;
    const Voxels want = Voxels(box.nx / f[0], box.ny / f[1], box.nz / f[2]).fill([&](auto x, auto y, auto z) {
      std::uint32_t set = 0;
      for (std::uint32_t i = 0; i < f[0] * f[1] * f[2]; ++i)
        set += box.at(x * f[0] + i % f[0], y * f[1] + i / f[0] % f[1], z * f[2] + i / f[0] / f[1]);
      const std::uint32_t all = f[0] * f[1] * f[2];
      return 2 * set == all ? box.at(x * f[0], y * f[1], z * f[2]) != 0 : 2 * set > all;
    });
    const VoxelStack wanted = stack_of(want);
    EXPECT_EQ(got.view().size(), wanted.view().size()) << seed;
    EXPECT_EQ(got.change, wanted.change) << seed;
    EXPECT_EQ(got.row_offset, wanted.row_offset) << seed;
    EXPECT_EQ(got.edge[0], kEdge[0] * static_cast<Nm>(f[0]));
    EXPECT_TRUE(got.periodic[0]);
  }
}

}  // namespace
}  // namespace lamina::pores
