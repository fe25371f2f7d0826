// tests/stokes/test_section.cpp: planes through a flow: as much passes each of them, and the fastest place is the fastest.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stages/stokes/flow.h"
#include "tests/pores/boxes.h"

namespace lamina {
namespace {

using pores::testing::stack_of;
using pores::testing::Voxels;

/// A slit that two bumps narrow, wide along x and narrow along y; fluid flows along z.
VoxelStack narrowed_slit() {
  return stack_of(Voxels(30, 20, 24).fill([](auto x, auto y, auto z) {
    const double bump = 4 * std::exp(-std::pow((z - 9.0) / 4, 2)) * std::exp(-std::pow((x - 20.0) / 12, 2));
    return y < 2 + bump || y >= 18 - bump || x < 1;
  }),
                  {true, true, true});
}

struct Solved {
  stokes::Grid grid;
  stokes::Field field;
  stokes::Flow flow;
};
Solved solved(const VoxelStack& solid, int axis) {
  Solved result{*stokes::make_grid(solid, 4), {}, {}};
  result.field = stokes::field_of(result.grid.cells);
  stokes::FlowOptions options;
  options.tolerance = 1e-5;
  result.flow = *stokes::solve(result.grid, axis, options, result.field);
  return result;
}

stokes::Section section_through(const VoxelStack& solid, const Solved& run, int axis, std::uint32_t ends) {
  return stokes::section_of({stokes::cell_positions(solid, 1), run.grid.cells.box, axis, axis}, run.grid.cells, run.field,
                            run.flow.permeability[static_cast<std::size_t>(axis)], ends);
}

double mean_of(const Plane& plane) {
  return std::accumulate(plane.value.begin(), plane.value.end(), 0.0) / static_cast<double>(plane.value.size());
}

TEST(Section, CellsLieWhereTheirNeighboursSay) {
  const VoxelStack solid = narrowed_slit();
  const stokes::Grid grid = *stokes::make_grid(solid, 4);
  const auto positions = stokes::cell_positions(solid, 1);
  ASSERT_EQ(positions.size(), grid.cells.size());
  for (std::uint32_t i = 0; i < grid.cells.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t above = grid.cells.neighbour[i][2 * a + 1];
      if (above == grid.cells.size()) continue;
      auto expected = positions[i];
      expected[a] = (expected[a] + 1) % grid.cells.box[a];
      ASSERT_EQ(positions[above], expected);
    }
  }
}

/// What flows in flows out: in units of the mean velocity, 1 on average through any plane across, wherever the throat is.
TEST(Section, AsMuchPassesTheThroatAsTheWholeBox) {
  const VoxelStack solid = narrowed_slit();
  const Solved run = solved(solid, 2);
  const stokes::Section section = section_through(solid, run, 2, 0);
  EXPECT_NEAR(mean_of(section.across), 1, 0.01);
  EXPECT_EQ(section.across.columns, 30u);
  EXPECT_EQ(section.across.rows, 20u);
  EXPECT_NEAR(section.fastest[1], 9.5, 1) << "the middle of the slit";
  EXPECT_EQ(section.fastest[2], 9u) << "creeping flow is the same backwards: fastest between the tops of the bumps";
}

TEST(Section, TheFastestPositionIsInBothPlanesAndSpeedIsNoLessThanVelocity) {
  const VoxelStack solid = narrowed_slit();
  const Solved run = solved(solid, 2);
  const stokes::Section section = section_through(solid, run, 2, 0);
  const auto& [x, y, z] = section.fastest;
  const float fastest = section.across.value[x + 30 * y];
  EXPECT_EQ(fastest, *std::ranges::max_element(section.across.value));
  ASSERT_EQ(section.along.normal, 0) << "the slit is narrow along y, so that y and z are drawn";
  EXPECT_EQ(section.along.at, x);
  ASSERT_EQ(section.along.columns, 20u);
  for (std::uint32_t row = 0; row < 20; ++row) {
    const float speed = section.along.value[row + 20 * z], velocity = section.across.value[x + 30 * row];
    EXPECT_GE(speed, velocity - 1e-6f);
    EXPECT_EQ(speed == 0, velocity == 0) << "solid in both";
  }
}

/// Poiseuille: 1.5 times the mean of the slit, 16 of 20 voxels wide. The nearest velocities lie half a voxel off its middle,
/// where it is 1 / 16^2 slower; the scheme is of second order.
TEST(Section, TheMiddleOfASlitIsHalfAsFastAgainAsItsMean) {
  const VoxelStack solid =
      stack_of(Voxels(4, 20, 4).fill([](auto, auto y, auto) { return y < 2 || y >= 18; }), {true, true, true});
  const Solved run = solved(solid, 0);
  const stokes::Section section = section_through(solid, run, 0, 0);
  EXPECT_EQ(section.across.normal, 0);
  EXPECT_NEAR(*std::ranges::max_element(section.across.value), 1.5 * 20 / 16, 1.5 * 20 / 16 * 2.5 / 256);
}

TEST(Section, FluidBeforeTheEndsIsLeftOut) {
  const VoxelStack solid = narrowed_slit();
  const Solved run = solved(solid, 2);
  const stokes::Section whole = section_through(solid, run, 2, 0), inner = section_through(solid, run, 2, 3);
  EXPECT_EQ(inner.size[2], 18u);
  EXPECT_EQ(inner.fastest[2] + 3, whole.fastest[2]);
  EXPECT_EQ(inner.across.value, whole.across.value);
  ASSERT_EQ(inner.along.rows, 18u);
  EXPECT_TRUE(std::ranges::equal(inner.along.value, std::span(whole.along.value).subspan(3 * 20, 18 * 20)));
}

}  // namespace
}  // namespace lamina
