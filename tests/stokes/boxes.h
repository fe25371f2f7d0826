// tests/stokes/boxes.h: boxes of voxels from a function that says what is solid.
#pragma once

#include "stages/data/voxels.h"

namespace lamina::test {

/// solid  called with the place of a voxel's centre, in voxels. The box repeats along all axes, edges are 1 um.
template <class Solid>
VoxelStack box_of(std::uint32_t nx, std::uint32_t ny, std::uint32_t nz, const Solid& solid) {
  VoxelStack box(nx, ny, {1000, 1000, 1000}, {true, true, true});
  for (std::uint32_t z = 0; z < nz; ++z) {
    Runs slice;
    slice.columns = nx;
    slice.row_offset.assign(1, 0);
    for (std::uint32_t y = 0; y < ny; ++y) {
      bool in = false;
      for (std::uint32_t x = 0; x <= nx; ++x) {
        const bool is = x < nx && solid(x + 0.5, y + 0.5, z + 0.5);
        if (is != in) slice.change.push_back(x);
        in = is;
      }
      slice.row_offset.push_back(static_cast<std::uint32_t>(slice.change.size()));
    }
    box.append(slice);
  }
  return box;
}

}  // namespace lamina::test
