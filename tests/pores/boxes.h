// Boxes of voxels for tests of pores, and what is true of them by looking at every voxel.
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <vector>

#include "stages/data/voxels.h"

namespace lamina::pores::testing {

inline constexpr std::array<Nm, 3> kEdge{10'000, 10'000, 10'000};  // 0.01 mm

/// One byte a voxel, x fastest; 1 is solid.
struct Voxels {
  std::uint32_t nx, ny, nz;
  std::vector<std::uint8_t> solid;

  Voxels(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::uint8_t all = 0)
      : nx(x), ny(y), nz(z), solid(std::size_t{x} * y * z, all) {}
  std::size_t index(std::uint32_t x, std::uint32_t y, std::uint32_t z) const { return x + nx * (y + std::size_t{ny} * z); }
  std::uint8_t& at(std::uint32_t x, std::uint32_t y, std::uint32_t z) { return solid[index(x, y, z)]; }
  std::uint8_t at(std::uint32_t x, std::uint32_t y, std::uint32_t z) const { return solid[index(x, y, z)]; }

  /// Sets what a function of the voxel says.
  template <class Is>
  Voxels& fill(const Is& is) {
    for (std::uint32_t z = 0; z < nz; ++z) {
      for (std::uint32_t y = 0; y < ny; ++y) {
        for (std::uint32_t x = 0; x < nx; ++x) at(x, y, z) = is(x, y, z) ? 1 : 0;
      }
    }
    return *this;
  }
};

inline Runs slice_of(const Voxels& box, std::uint32_t z) {
  Runs runs;
  runs.columns = box.nx;
  runs.row_offset.push_back(0);
  for (std::uint32_t y = 0; y < box.ny; ++y) {
    std::uint8_t before = 0;
    for (std::uint32_t x = 0; x < box.nx; ++x) {
      if (box.at(x, y, z) != before) runs.change.push_back(x);
      before = box.at(x, y, z);
    }
    if (before != 0) runs.change.push_back(box.nx);
    runs.row_offset.push_back(static_cast<std::uint32_t>(runs.change.size()));
  }
  return runs;
}

inline VoxelStack stack_of(const Voxels& box, std::array<bool, 3> periodic = {}, std::array<Nm, 3> edge = {1000, 1000, 1000}) {
  VoxelStack stack(box.nx, box.ny, edge, periodic);
  for (std::uint32_t z = 0; z < box.nz; ++z) stack.append(slice_of(box, z));
  return stack;
}

/// Axis i of the result is axis order[i] of the box, backwards where told.
inline Voxels turned(const Voxels& box, std::array<int, 3> order, std::array<bool, 3> backwards = {}) {
  const std::array<std::uint32_t, 3> size{box.nx, box.ny, box.nz};
  Voxels out(size[order[0]], size[order[1]], size[order[2]]);
  const std::array<std::uint32_t, 3> turned_size{out.nx, out.ny, out.nz};
  return out.fill([&](std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    const std::array<std::uint32_t, 3> from{x, y, z};
    std::array<std::uint32_t, 3> at{};
    for (std::size_t i = 0; i < 3; ++i) at[order[i]] = backwards[i] ? turned_size[i] - 1 - from[i] : from[i];
    return box.at(at[0], at[1], at[2]) != 0;
  });
}

/// Blobs of a few voxels rather than noise, so that parts have some size.
inline Voxels random_box(std::uint32_t seed, std::uint32_t maximum = 9) {
  std::mt19937 random(seed);
  const auto below = [&](std::uint32_t n) { return static_cast<std::uint32_t>(random() % n); };
  Voxels box(1 + below(maximum), 1 + below(maximum), 1 + below(maximum));
  const std::uint32_t percent = 20 + below(70);
  box.fill([&](auto, auto, auto) { return below(100) < percent; });
  return box;
}

/// Neighbours of a voxel by its faces, across periodic ends too: take(x, y, z, axis, step of boxes).
template <class Take>
void for_each_neighbour(const Voxels& box, std::array<bool, 3> periodic, std::array<std::uint32_t, 3> at, const Take& take) {
  const std::array<std::uint32_t, 3> size{box.nx, box.ny, box.nz};
  for (int axis = 0; axis < 3; ++axis) {
    for (const int step : {-1, 1}) {
      std::array<std::uint32_t, 3> to = at;
      const bool leaves = step < 0 ? at[axis] == 0 : at[axis] + 1 == size[axis];
      if (leaves && !periodic[axis]) continue;
      to[axis] = leaves ? (step < 0 ? size[axis] - 1 : 0) : at[axis] + step;
      take(to, axis, leaves ? step : 0);
    }
  }
}

}  // namespace lamina::pores::testing
