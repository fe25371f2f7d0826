// stages/coverage/voxel.h: a box of the second contract, and how its share becomes a level.
#pragma once

#include <cstdint>

#include "stages/data/choices.h"
#include "stages/data/grid.h"

namespace lamina::coverage {

/// Samples along a side of a voxel.
inline constexpr std::int64_t kSamples = 8;
inline constexpr std::uint32_t kAllSamples = kSamples * kSamples * kSamples;

/// nm.
struct Voxel {
  std::int64_t x0, x1, y0, y1, z0, z1;
};

/// nm; a voxel's nominal sides, which true ones differ from by less than 1.
struct VoxelSides {
  double x, y, z;
};

/// The same of a row of voxels in a layer.
struct Strip {
  std::int64_t y0, y1, z0, z1;
  double area() const { return static_cast<double>(y1 - y0) * static_cast<double>(z1 - z0); }
};

/// What all rows share.
struct Rule {
  FillRule fill;
  std::uint32_t top_level;  // n
};

/// The level of `solid` samples of a voxel.
constexpr std::uint32_t level_of_samples(std::uint32_t solid, std::uint32_t top_level) {
  return (2 * solid * top_level + kAllSamples) / (2 * kAllSamples);
}

}  // namespace lamina::coverage
