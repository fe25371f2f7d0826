#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <map>
#include <vector>

#include "stages/pores/porosity.h"
#include "stages/pores/rows.h"
#include "tests/pores/boxes.h"

namespace lamina::pores {
namespace {

using testing::random_box;
using testing::stack_of;
using testing::turned;
using testing::Voxels;

TEST(VoxelStack, SlicesThatAreAppendedAreTheBox) {
  const Voxels box = random_box(3);
  const VoxelStack stack = stack_of(box);
  EXPECT_EQ(stack.nz, box.nz);
  EXPECT_EQ(set_voxels(stack), static_cast<std::uint64_t>(std::count(box.solid.begin(), box.solid.end(), 1)));
  for (std::uint32_t z = 0; z < box.nz; ++z) {
    const Runs expected = testing::slice_of(box, z);
    const VoxelView slice = stack.view().slice(z);
    for (std::uint32_t y = 0; y < box.ny; ++y) {
      EXPECT_TRUE(std::ranges::equal(slice.row(y, 0), expected.view().row(y)));
      EXPECT_TRUE(std::ranges::equal(stack.view().row(y, z), expected.view().row(y)));
    }
  }
}

// Voxels of the void by flooding from each that no part has yet, with the cell each is reached in.
struct Flooded {
  std::vector<int> part;  // -1: none
  std::vector<std::uint64_t> voxels;
  std::vector<std::uint8_t> faces, wraps, neighbour;
};

Flooded flood(const Voxels& box, const Voxels& body, std::array<bool, 3> periodic) {
  using At = std::array<std::uint32_t, 3>;
  Flooded result;
  result.part.assign(box.solid.size(), -1);
  std::vector<std::array<int, 3>> cell(box.solid.size());
  const std::array<std::uint32_t, 3> size{box.nx, box.ny, box.nz};
  const auto index = [&](const At& at) { return box.index(at[0], at[1], at[2]); };
  for (std::uint32_t z = 0; z < box.nz; ++z) {
    for (std::uint32_t y = 0; y < box.ny; ++y) {
      for (std::uint32_t x = 0; x < box.nx; ++x) {
        const std::size_t start = box.index(x, y, z);
        if (box.solid[start] != 0 || body.solid[start] == 0 || result.part[start] >= 0) continue;
        const int part = static_cast<int>(result.voxels.size());
        std::uint64_t voxels = 0;
        std::uint8_t faces = 0, wraps = 0, neighbour = 0;
        std::vector<At> waiting{{x, y, z}};
        result.part[start] = part;
        cell[start] = {0, 0, 0};
        while (!waiting.empty()) {
          const At at = waiting.back();
          waiting.pop_back();
          ++voxels;
          for (int axis = 0; axis < 3; ++axis) {
            if (periodic[axis]) continue;
            if (at[axis] == 0) faces |= static_cast<std::uint8_t>(1 << (2 * axis));
            if (at[axis] + 1 == size[axis]) faces |= static_cast<std::uint8_t>(2 << (2 * axis));
          }
          testing::for_each_neighbour(box, periodic, at, [&](const At& to, int axis, int step) {
            if (box.solid[index(to)] != 0) return;
            if (body.solid[index(to)] == 0) {
              neighbour = 1;
              return;
            }
            std::array<int, 3> expected = cell[index(at)];
            expected[axis] += step;
            if (result.part[index(to)] < 0) {
              result.part[index(to)] = part;
              cell[index(to)] = expected;
              waiting.push_back(to);
            } else {
              for (int i = 0; i < 3; ++i) {
                if (cell[index(to)][i] != expected[i]) wraps |= static_cast<std::uint8_t>(1 << i);
              }
            }
          });
        }
        result.voxels.push_back(voxels);
        result.faces.push_back(faces);
        result.wraps.push_back(wraps);
        result.neighbour.push_back(neighbour);
      }
    }
  }
  return result;
}

std::array<bool, 3> periodic_of(std::uint32_t bits) { return {(bits & 1) != 0, (bits & 2) != 0, (bits & 4) != 0}; }

TEST(Parts, AreThoseOfAFloodOfEveryVoxel) {
  for (std::uint32_t seed = 0; seed < 600; ++seed) {
    Voxels box = random_box(seed);
    if (seed % 20 == 7) {  // higher than the slices that one thread joins
      std::mt19937 random(seed);
      box = Voxels(4, 5, 30 + seed % 40).fill([&](auto, auto, auto) { return random() % 100 < 60; });
    }
    Voxels body(box.nx, box.ny, box.nz, 1);
    if (seed % 3 == 0) body.fill([&](auto x, auto y, auto z) { return (x * 7 + y * 3 + z * 5 + seed) % 11 > 2; });
    const std::array<bool, 3> periodic = periodic_of(seed / 3 % 8);
    const VoxelStack solid = stack_of(box, periodic), inside = stack_of(body, periodic);
    const Flooded expected = flood(box, body, periodic);
    const VoxelView inside_view = inside;
    const VoxelStack empty = void_of(solid, &inside_view);
    const Parts parts = parts_of(empty);
    ASSERT_EQ(parts.size(), expected.voxels.size()) << seed;
    EXPECT_TRUE(std::ranges::equal(parts.voxels, expected.voxels)) << seed;
    EXPECT_TRUE(std::ranges::equal(parts.faces, expected.faces)) << seed;
    EXPECT_TRUE(std::ranges::equal(parts.wraps, expected.wraps)) << seed;
    EXPECT_TRUE(std::ranges::equal(adjacent_parts(empty, parts, without(void_of(solid), inside)), expected.neighbour)) << seed;
    std::size_t run = 0;
    for (std::uint32_t z = 0; z < box.nz; ++z) {
      for (std::uint32_t y = 0; y < box.ny; ++y) {
        const auto row = empty.view().row(y, z);
        for (std::size_t i = 0; i < row.size(); i += 2, ++run) {
          ASSERT_EQ(static_cast<int>(parts.part_of(run)), expected.part[box.index(row[i], y, z)]);
        }
      }
    }
  }
}

TEST(Parts, AreTheSameForAnyNumberOfThreads) {
  const Voxels box = Voxels(40, 40, 70).fill([](auto x, auto y, auto z) { return (x * x + 3 * y * z + z) % 7 < 4; });
  const VoxelStack solid = stack_of(box, {true, false, true});
  const auto all = [&] {
    const VoxelStack empty = void_of(solid);
    Parts parts = parts_of(empty);
    return std::make_pair(empty.change, std::move(parts));
  };
  std::vector<decltype(all())> results;
  for (const std::size_t threads : {1, 2, 7}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    results.push_back(all());
  }
  for (const auto& [change, parts] : results) {
    EXPECT_EQ(change, results[0].first);
    EXPECT_EQ(parts.piece, results[0].second.piece);
    EXPECT_EQ(parts.part, results[0].second.part);
    EXPECT_EQ(parts.voxels, results[0].second.voxels);
  }
}

// A box of 10 x 10 x 10 with a straight hole of 2 x 3, a blind hole of 5 voxels and a cavity of 8.
Voxels with_holes() {
  return Voxels(10, 10, 10).fill([](auto x, auto y, auto z) {
    const bool through = x >= 1 && x < 3 && y >= 1 && y < 4;
    const bool blind = x == 5 && y == 5 && z >= 5;
    const bool cavity = x >= 7 && x < 9 && y >= 7 && y < 9 && z >= 4 && z < 6;
    return !(through || blind || cavity);
  });
}

TEST(Porosity, HolesBlindHolesAndCavitiesAreDistinguished) {
  const VoxelStack solid = stack_of(with_holes());
  const Porosity p = porosity(solid);
  EXPECT_DOUBLE_EQ(p.total(), (60 + 5 + 8) / 1000.0);
  EXPECT_DOUBLE_EQ(p.connected(), 65 / 1000.0);
  EXPECT_DOUBLE_EQ(p.percolating(2), 60 / 1000.0);
  EXPECT_DOUBLE_EQ(p.percolating(0), 0);
  EXPECT_EQ(p.cavities, 1u);
  EXPECT_EQ(p.parts, 3u);
  EXPECT_DOUBLE_EQ(static_cast<double>(p.empty - p.open) * p.voxel_mm3, 8e-9);
  EXPECT_EQ(porosity(solid, nullptr, kFacesX).open, 0u);
  EXPECT_EQ(porosity(solid, nullptr, kFacesX | 16).open, 60u);  // the lower z face: not the blind hole
}

TEST(Porosity, ABoxThatRepeatsOpensWhatGoesOnForEver) {
  const Porosity p = porosity(stack_of(with_holes(), {true, true, true}));
  EXPECT_EQ(p.open, 60u);
  EXPECT_EQ(p.cavities, 2u);  // the blind hole ends on both sides
  // A slit in x y goes on for ever, but not along z.
  const Voxels slit = Voxels(4, 5, 6).fill([](auto, auto, auto z) { return z != 2; });
  EXPECT_EQ(porosity(stack_of(slit, {true, true, true})).open, 0u);
  EXPECT_EQ(porosity(stack_of(slit, {true, true, true}), nullptr, kAllFaces).open, 20u);
  EXPECT_EQ(porosity(stack_of(slit, {true, true, true})).through, (std::array<std::uint64_t, 3>{20, 20, 0}));
}

TEST(Porosity, TheVoidThatLeadsThroughIsThatOfItsParts) {
  const VoxelStack solid = stack_of(with_holes(), {true, false, false});
  const VoxelStack hole = void_through(solid, 2);
  EXPECT_EQ(set_voxels(hole), 60u);
  for (std::uint32_t z = 0; z < 10; ++z)
    for (std::uint32_t y = 0; y < 10; ++y)
      EXPECT_TRUE(
          std::ranges::equal(hole.view().row(y, z), y >= 1 && y < 4 ? Buffer<std::uint32_t>{1, 3} : Buffer<std::uint32_t>{}));
  EXPECT_EQ(set_voxels(void_through(solid, 0)), 0u);
  EXPECT_EQ(hole.periodic, solid.periodic);
}

// A helix that climbs one box each time it goes around in x: through along x and z only if both repeat.
TEST(Porosity, AStairThatLeavesByTheSideComesBackHigher) {
  const Voxels stair = Voxels(4, 1, 4).fill([](auto x, auto, auto z) { return !(x == z || x == (z + 1) % 4); });
  EXPECT_EQ(porosity(stack_of(stair, {true, true, true})).through, (std::array<std::uint64_t, 3>{8, 8, 8}));
  EXPECT_EQ(porosity(stack_of(stair, {false, true, true})).through, (std::array<std::uint64_t, 3>{8, 8, 0}));
  EXPECT_EQ(porosity(stack_of(stair, {true, true, false})).through, (std::array<std::uint64_t, 3>{0, 8, 8}));
}

TEST(Porosity, ACheckerboardIsHalfVoidAndNothingHangsTogether) {
  const Voxels board = Voxels(6, 6, 6).fill([](auto x, auto y, auto z) { return (x + y + z) % 2 == 0; });
  for (const bool periodic : {false, true}) {
    const Porosity p = porosity(stack_of(board, {periodic, periodic, periodic}), nullptr, kAllFaces);
    EXPECT_DOUBLE_EQ(p.total(), 0.5);
    EXPECT_EQ(p.parts, 108u);
    EXPECT_EQ(p.through, (std::array<std::uint64_t, 3>{}));
    EXPECT_EQ(p.open, periodic ? 0u : 108u - 32u);  // of 4 x 4 x 4 inner voxels half are void
  }
}

TEST(Porosity, OnlyVoidOfTheBodyCountsAndIsOpenTowardsVoidOutside) {
  // A tube that lies in a void box: its bore is open at the ends, its cavity is not, the wall's dent is.
  Voxels solid(9, 9, 7), body(9, 9, 7);
  body.fill([](auto x, auto y, auto z) { return x >= 1 && x < 8 && y >= 1 && y < 8 && z >= 1 && z < 6; });
  solid = body;
  for (std::uint32_t z = 1; z < 6; ++z) solid.at(3, 3, z) = 0;
  solid.at(5, 5, 3) = 0;
  solid.at(7, 4, 3) = 0;
  const VoxelStack inside = stack_of(body);
  const VoxelView view = inside;
  const Porosity p = porosity(stack_of(solid), &view);
  EXPECT_EQ(p.body, 245u);
  EXPECT_EQ(p.empty, 7u);
  EXPECT_EQ(p.open, 6u);
  EXPECT_EQ(p.cavities, 1u);
}

TEST(Porosity, TurnedAndMirroredBoxesAreTheSame) {
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    const Voxels box = random_box(seed, 12);
    const std::array<bool, 3> periodic = periodic_of(seed % 8);
    const Porosity straight = porosity(stack_of(box, periodic), nullptr, kAllFaces);
    const std::array<int, 3> order{1, 2, 0};
    const Porosity other =
        porosity(stack_of(turned(box, order, {true, seed % 2 == 0, false}), {periodic[1], periodic[2], periodic[0]}), nullptr,
                 kAllFaces);
    EXPECT_EQ(other.open, straight.open);
    EXPECT_EQ(other.parts, straight.parts);
    EXPECT_EQ(other.cavities, straight.cavities);
    for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(other.through[i], straight.through[static_cast<std::size_t>(order[i])]);
  }
}

TEST(Porosity, EmptyAndFullBoxes) {
  const Porosity none = porosity(stack_of(Voxels(3, 3, 3, 1)));
  EXPECT_EQ(none.empty, 0u);
  EXPECT_EQ(none.parts, 0u);
  const Porosity all = porosity(stack_of(Voxels(3, 3, 3)));
  EXPECT_DOUBLE_EQ(all.connected(), 1);
  EXPECT_DOUBLE_EQ(all.percolating(0), 1);
  EXPECT_DOUBLE_EQ(porosity(VoxelStack(4, 4, {1, 1, 1})).total(), 0);
}

}  // namespace
}  // namespace lamina::pores
