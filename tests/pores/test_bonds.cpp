#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "stages/pores/porosity.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::kEdge;
using testing::random_box;
using testing::stack_of;
using testing::Voxels;

using Cell = std::array<int, 3>;

/// Void that a flood reaches which steps to the six neighbours and over up to `contact` solid voxels along z, from those of its
/// groups that touch z's ends or come back to themselves in the box above.
std::uint64_t slow_unbonded(const Voxels& box, std::array<bool, 3> periodic, std::uint32_t contact) {
  const std::array<std::int64_t, 3> size{box.nx, box.ny, box.nz};
  std::vector<Cell> cell(box.solid.size());
  std::vector<std::uint8_t> detected(box.solid.size(), 0);
  std::uint64_t reached = 0;
  for (std::size_t start = 0; start < box.solid.size(); ++start) {
    if (box.solid[start] != 0 || detected[start] != 0) continue;
    std::vector<std::size_t> group{start};
    detected[start] = 1;
    cell[start] = {};
    bool open = false;
    for (std::size_t done = 0; done < group.size(); ++done) {
      const std::size_t at = group[done];
      const std::array<std::int64_t, 3> from{static_cast<std::int64_t>(at % box.nx),
                                             static_cast<std::int64_t>(at / box.nx % box.ny),
                                             static_cast<std::int64_t>(at / box.nx / box.ny)};
      if (!periodic[2] && (from[2] == 0 || from[2] == size[2] - 1)) open = true;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const int far = axis == 2 ? static_cast<int>(contact) + 1 : 1;
        for (int step = -far; step <= far; ++step) {
          auto to = from;
          to[axis] += step;
          Cell there = cell[at];
          while (to[axis] < 0) to[axis] += size[axis], --there[axis];
          while (to[axis] >= size[axis]) to[axis] -= size[axis], ++there[axis];
          if (step == 0 || (there != cell[at] && !periodic[axis])) continue;
          const std::size_t next = box.index(static_cast<std::uint32_t>(to[0]), static_cast<std::uint32_t>(to[1]),
                                             static_cast<std::uint32_t>(to[2]));
          if (box.solid[next] != 0) continue;
          if (detected[next] == 0) {
            detected[next] = 1;
            cell[next] = there;
            group.push_back(next);
          } else if (cell[next][2] != there[2]) {
            open = true;
          }
        }
      }
    }
    if (open) reached += group.size();
  }
  return reached;
}

TEST(Bonds, WhatContactsLetThroughIsWhatAFloodOverThemReaches) {
  for (std::uint32_t seed = 0; seed < 400; ++seed) {
    const Voxels box = random_box(seed, 9);
    const std::array<bool, 3> periodic{seed % 2 == 0, seed % 4 < 2, seed % 8 < 4};
    const std::uint32_t contact = seed % 5;
    const VoxelStack solid = stack_of(box, periodic, kEdge);
    const Connected found = connected(solid, 0, static_cast<Nm>(contact) * 10'000 + 9'999);
    EXPECT_EQ(found.unbonded, slow_unbonded(box, periodic, contact)) << seed;
    EXPECT_EQ(found.bonded, porosity(solid).open) << seed;  // no gap is closed
    EXPECT_EQ(found.voxels, solid.view().voxels());
    EXPECT_GE(found.unbonded, found.bonded);
  }
}

// Beads along x, 10 voxels wide and 9 high, whose round sides meet over 3: a pore of 4 voxels after every third one.
TEST(Bonds, CuspsThatTouchNoPoreAreOpenOnlyWhereContactsLeak) {
  const Voxels beads = Voxels(6, 34, 9).fill([](auto, auto y, auto z) {
    if (y >= 30) return false;
    const std::uint32_t from_side = std::min(y % 10, 9 - y % 10), from_middle = z < 4 ? 4 - z : z - 4;
    return from_middle <= 1 + from_side;
  });
  const VoxelStack solid = stack_of(beads, {true, true, true}, kEdge);
  const double box = 34 * 9;
  // 12 voxels of cusp at each side of a bead: of four sides between beads, and of two that belong to the pore.
  const double cusps = 4 * 12, pore = 4 * 9 + 2 * 12;
  EXPECT_NEAR(porosity(solid).total(), (cusps + pore) / box, 1e-12);
  EXPECT_NEAR(connected(solid, 0, 29'999).unbonded_share(), pore / box, 1e-12);  // contacts of three voxels hold
  const Connected found = connected(solid, 0, 30'000);
  EXPECT_NEAR(found.bonded_share(), pore / box, 1e-12);
  EXPECT_NEAR(found.unbonded_share(), (cusps + pore) / box, 1e-12);
  // A gap as wide as the pore closes it too; what is left of its cusps is reached by nothing.
  EXPECT_EQ(connected(solid, 40'000, 0).bonded, 0u);
  // Half a voxel rounds up.
  const VoxelStack twice = bond(solid, 15'000), closed = close_gaps(close_gaps(solid, 0, 20'000), 1, 20'000);
  EXPECT_EQ(twice.change, closed.change);
}

TEST(Bonds, EmptyAndFullBoxes) {
  const VoxelStack full = stack_of(Voxels(3, 4, 5, 1), {true, true, true}, kEdge),
                   empty = stack_of(Voxels(3, 4, 5, 0), {}, kEdge);
  EXPECT_EQ(connected(full, 20'000, 20'000).unbonded_share(), 0);
  EXPECT_EQ(connected(empty, 20'000, 20'000).bonded_share(), 1);
  EXPECT_EQ(connected(empty, 20'000, 20'000).unbonded_share(), 1);
  EXPECT_EQ(Connected().bonded_share(), 0);
}

}  // namespace
}  // namespace lamina::pores
