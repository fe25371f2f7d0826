// tests/stokes/test_canonical.cpp: however a box lies, its permeability has the same digits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <vector>

#include "stages/stokes/canonical.h"
#include "stages/stokes/flow.h"
#include "tests/pores/boxes.h"

namespace lamina {
namespace {

using pores::testing::Voxels;
using Tensor = std::array<std::array<double, 3>, 3>;

constexpr std::uint32_t kFineCut = 3;

/// All 48 ways, 24 turns and their mirrors.
std::vector<stokes::Turn> all_turns() {
  std::vector<stokes::Turn> paths;
  std::array<std::size_t, 3> from{0, 1, 2};
  do {
    for (unsigned m = 0; m < 8; ++m) paths.push_back({from, {(m & 1) != 0, (m & 2) != 0, (m & 4) != 0}});
  } while (std::next_permutation(from.begin(), from.end()));
  return paths;
}

template <class Value>
std::array<Value, 3> reordered(const std::array<Value, 3>& value, const stokes::Turn& way) {
  return {value[way.from[0]], value[way.from[1]], value[way.from[2]]};
}

struct Lying {
  Voxels voxels;
  std::array<bool, 3> periodic;
  std::array<Nm, 3> edge;
  VoxelStack stack() const { return pores::testing::stack_of(voxels, periodic, edge); }
  Lying by(const stokes::Turn& way) const {
    const std::array order{static_cast<int>(way.from[0]), static_cast<int>(way.from[1]), static_cast<int>(way.from[2])};
    return {pores::testing::turned(voxels, order, way.backwards), reordered(periodic, way), reordered(edge, way)};
  }
};

Tensor tensor_of(const Lying& lying) {
  const VoxelStack box = lying.stack();
  Tensor k{};
  for (int axis = 0; axis < 3; ++axis) {
    const Result<stokes::Canonical> canonical = stokes::Canonical::of(box, axis);
    EXPECT_TRUE(canonical.ok());
    const Result<stokes::Grid> grid = stokes::make_grid(canonical->view(), kFineCut, 4);
    EXPECT_TRUE(grid.ok());
    stokes::Field field = stokes::field_of(grid->cells);
    const Result<stokes::Flow> flow = stokes::solve(*grid, stokes::Canonical::kAxis, {}, field);
    EXPECT_TRUE(flow.ok());
    k[static_cast<std::size_t>(axis)] = canonical->in_box(flow->permeability);
  }
  return k;
}

/// What a turned box must have: both indices follow their axes, and a mirror turns the sign.
Tensor expected(const Tensor& k, const stokes::Turn& way) {
  Tensor turned{};
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b)
      turned[a][b] = (way.backwards[a] != way.backwards[b] ? -1 : 1) * k[way.from[a]][way.from[b]];
  return turned;
}

void expect_the_same_however_it_lies(const Lying& lying) {
  const Tensor k = tensor_of(lying);
  for (const stokes::Turn& way : all_turns()) {
    const Tensor found = tensor_of(lying.by(way)), wanted = expected(k, way);
    for (std::size_t a = 0; a < 3; ++a)
      for (std::size_t b = 0; b < 3; ++b)
        EXPECT_EQ(found[a][b], wanted[a][b]) << a << b << " axes " << way.from[0] << way.from[1] << way.from[2] << " backwards "
                                             << way.backwards[0] << way.backwards[1] << way.backwards[2];
  }
}

Voxels odd_blobs(std::uint32_t nx, std::uint32_t ny, std::uint32_t nz, unsigned seed) {
  std::mt19937 random(seed);
  const auto some = [&](double maximum) { return maximum * static_cast<double>(random() % 1000) * 1e-3; };
  std::vector<std::array<double, 4>> balls(7);
  for (auto& ball : balls) ball = {some(nx), some(ny), some(nz), 4 + some(4)};
  const auto off = [](std::uint32_t at, double centre, std::uint32_t size) {
    return std::remainder(at + 0.5 - centre, static_cast<double>(size));
  };
  return Voxels(nx, ny, nz).fill([&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return std::any_of(balls.begin(), balls.end(), [&](const auto& ball) {
      return std::hypot(off(x, ball[0], nx), off(y, ball[1], ny), off(z, ball[2], nz)) < ball[3];
    });
  });
}

TEST(CanonicalBox, BlobsHaveTheSameDigitsHoweverTheyLie) {
  expect_the_same_however_it_lies({odd_blobs(24, 24, 24, 5), {true, true, true}, {1000, 1000, 1000}});
  expect_the_same_however_it_lies({odd_blobs(21, 27, 24, 6), {true, true, true}, {1000, 1000, 1000}});
}

TEST(CanonicalBox, AxesAreDistinguishedByTheirEdgesAndEnds) {
  expect_the_same_however_it_lies({odd_blobs(24, 24, 24, 7), {true, false, true}, {1000, 1000, 700}});
}

/// Crossed lines, every other pair of layers moved aside.
Lying window_of_beads(double aside) {
  const std::uint32_t apart = 24, high = 9;
  Lying beads{Voxels(apart, apart, 4 * high), {true, true, true}, {1000, 1000, 1000}};
  beads.voxels.fill([&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    const std::uint32_t layer = z / high;
    const double across = layer % 2 == 0 ? x + 0.5 : y + 0.5;
    const double u = std::remainder(across - (layer / 2 == 1 ? aside : 0), double{apart}) / 7, v = (z % high - 4.0) / 4.6;
    return u * u + v * v < 1;
  });
  return beads;
}

TEST(CanonicalBox, AWindowOfBeadsHasTheSameDigitsHoweverItLies) { expect_the_same_however_it_lies(window_of_beads(8)); }

/// Mirrors of its own: several turns give the same voxels.
TEST(CanonicalBox, WhatSymmetryForbidsIsNothing) {
  const Lying beads = window_of_beads(12);
  expect_the_same_however_it_lies(beads);
  const Tensor k = tensor_of(beads);
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t b = 0; b < 3; ++b) EXPECT_EQ(k[a][b] != 0, a == b);
}

TEST(CanonicalBox, PositionsAreFoundBothDirections) {
  const Lying lying{odd_blobs(9, 6, 12, 8), {}, {1000, 1000, 1000}};
  const VoxelStack box = lying.stack();
  std::set<stokes::CellIndex> detected;
  const Result<stokes::Canonical> canonical = stokes::Canonical::of(box, 0);
  ASSERT_TRUE(canonical.ok());
  const VoxelView turned = canonical->view();
  const stokes::Turn& turn = canonical->turn();
  EXPECT_EQ(turn.from[stokes::Canonical::kAxis], 0u);
  EXPECT_EQ(set_voxels(turned), set_voxels(box));
  const auto solid = [](const VoxelView& of, const stokes::CellIndex& at) {
    bool in = false;
    for (const std::uint32_t change : of.row(at[1], at[2])) in ^= change <= at[0];
    return in;
  };
  for (std::uint32_t z = 0; z < box.nz; ++z) {
    for (std::uint32_t y = 0; y < box.ny; ++y) {
      for (std::uint32_t x = 0; x < box.nx; ++x) {
        const stokes::CellIndex at{x, y, z}, there = turn.in_turned(at, turned.size());
        EXPECT_EQ(solid(turned, there), solid(box, at));
        EXPECT_EQ(turn.in_box(there, turned.size()), at);
        detected.insert(there);
      }
    }
  }
  EXPECT_EQ(detected.size(), box.view().voxels());
}

/// Inertia tells upstream from downstream: the end that the flow comes from stays.
TEST(CanonicalBox, WhatInertiaBendsIsNotReversed) {
  const Lying lying{odd_blobs(12, 12, 12, 9), {true, true, true}, {1000, 1000, 1000}};
  std::set<bool> reversed;
  for (const stokes::Turn& way : all_turns()) {
    const VoxelStack box = lying.by(way).stack();
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_FALSE(stokes::Canonical::of(box, axis, false)->turn().backwards[2]);
      reversed.insert(stokes::Canonical::of(box, axis)->turn().backwards[2]);
    }
  }
  EXPECT_EQ(reversed.size(), 2u);
}

}  // namespace
}  // namespace lamina
