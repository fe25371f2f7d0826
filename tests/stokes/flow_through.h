// tests/stokes/flow_through.h: creeping flow through a box of voxels, solved to its end.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "stages/stokes/flow.h"

namespace lamina::test {

/// factor  how many voxels of the solid a voxel of the flow is wide
inline stokes::Flow flow_through(const VoxelView& solid, int axis, double tolerance = 1e-5, std::uint32_t levels = 5,
                                 std::uint32_t factor = 1) {
  const Result<stokes::Grid> grid = stokes::make_grid(solid, factor, levels);
  EXPECT_TRUE(grid.ok());
  stokes::Field field = stokes::field_of(grid->cells);
  stokes::FlowOptions options;
  options.tolerance = tolerance;
  const Result<stokes::Flow> flow = stokes::solve(*grid, axis, options, field);
  EXPECT_TRUE(flow.ok());
  EXPECT_LE(flow->residual, std::max(tolerance, 5e-4)) << "wide pores end where single precision does";
  return *flow;
}

}  // namespace lamina::test
