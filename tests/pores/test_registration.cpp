#include <gtest/gtest.h>

#include <cmath>

#include "stages/pores/registration.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::stack_of;
using testing::Voxels;

/// Balls that nothing repeats; `grown` voxels larger.
bool in_balls(double x, double y, double z, double grown) {
  constexpr double kBalls[][4] = {{9, 8, 7, 5},    {24, 12, 20, 7}, {14, 27, 12, 6},
                                  {30, 30, 28, 8}, {6, 22, 30, 4},  {33, 5, 6, 5}};
  for (const auto& ball : kBalls)
    if (std::hypot(x - ball[0], y - ball[1], z - ball[2]) <= ball[3] + grown) return true;
  return false;
}

/// A box whose content lies at `shift` in a larger one.
VoxelStack larger(std::uint32_t side, std::uint32_t range, std::array<int, 3> shift, double grown) {
  const std::uint32_t all = side + 2 * range;
  return stack_of(Voxels(all, all, all).fill([&](auto x, auto y, auto z) {
    const double r = range;
    return in_balls(x - r - shift[0], y - r - shift[1], z - r - shift[2], grown);
  }));
}

TEST(Registration, FindsHowFarABoxIsShiftedInAnother) {
  constexpr std::uint32_t kSide = 36;
  const VoxelStack small =
      stack_of(Voxels(kSide, kSide, kSide).fill([](auto x, auto y, auto z) { return in_balls(x, y, z, 0); }));
  for (const std::array<int, 3> shift : {std::array{0, 0, 0}, {3, -2, 1}, {-8, 7, 8}, {5, 0, -6}}) {
    const Match same = find_shift(small, larger(kSide, 8, shift, 0), 8);
    EXPECT_EQ(same.shift, (std::array<std::int32_t, 3>{shift[0], shift[1], shift[2]}));
    EXPECT_EQ(same.differing(), 0u);
    const VoxelStack fat = larger(kSide, 8, shift, 1);
    const Match grown = find_shift(small, fat, 8);
    EXPECT_EQ(grown.shift, same.shift);
    EXPECT_EQ(grown.only_small, 0u);
    EXPECT_GT(grown.only_large, 0u);
  }
}

TEST(Registration, CountsWhatDiffersVoxelByVoxel) {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    const Voxels box = testing::random_box(seed, 7), other = testing::random_box(seed + 100, 7);
    const Voxels large = Voxels(box.nx + 4, box.ny + 4, box.nz + 4).fill([&](auto x, auto y, auto z) {
      return other.at(x % other.nx, y % other.ny, z % other.nz) != 0;
    });
    const Match match = find_shift(stack_of(box), stack_of(large), 2);
    std::uint64_t only_small = 0, only_large = 0;
    for (std::uint32_t z = 0; z < box.nz; ++z)
      for (std::uint32_t y = 0; y < box.ny; ++y)
        for (std::uint32_t x = 0; x < box.nx; ++x) {
          const auto at = [&](std::uint32_t position, std::size_t a) {
            return static_cast<std::uint32_t>(static_cast<int>(position) + 2 + match.shift[a]);
          };
          const bool a = box.at(x, y, z) != 0, b = large.at(at(x, 0), at(y, 1), at(z, 2)) != 0;
          only_small += a && !b;
          only_large += b && !a;
        }
    EXPECT_EQ(match.only_small, only_small) << seed;
    EXPECT_EQ(match.only_large, only_large) << seed;
  }
}

}  // namespace
}  // namespace lamina::pores
