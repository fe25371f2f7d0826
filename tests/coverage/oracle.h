// tests/coverage/oracle.h: the contract of shares, word for word, as slowly as it reads.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"

namespace lamina::test {

/// A window of the geometry: columns [left, right), rows [first, last).
struct VoxelWindow {
  std::uint32_t left, right, first, last;
};

/// Levels of the window's voxels, row by row from the front. Shares no code with the stage: volumes are what lies above facets
/// that the six planes of a voxel have cut, along z, in rationals; samples are counted one by one.
std::vector<std::uint8_t> oracle_levels(std::span<const Triangle> facets, const PixelGrid& grid, const Layer& layer,
                                        FillRule rule, std::uint32_t levels, const VoxelWindow& window);

}  // namespace lamina::test
