// tests/coverage/oracle.h: the contract of shares, word for word, as slowly as it reads.
#pragma once

#include <gmpxx.h>

#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "stages/data/choices.h"
#include "stages/data/grid.h"
#include "stages/data/layer.h"
#include "stages/data/mesh.h"

namespace lamina::test {

/// Of the layers of a part, sanitized tests take every third of those that the release takes.
#ifdef __SANITIZE_ADDRESS__
constexpr int kThinned = 3;
#else
constexpr int kThinned = 1;
#endif

/// A window of the geometry: columns [left, right), rows [first, last).
struct VoxelWindow {
  std::uint32_t left, right, first, last;
};

/// What no fill rule and no number of levels changes.
struct VoxelFacts {
  std::map<int, int> samples;  // how many have a winding number
  mpq_class share;             // of the exact solid; only where all winding numbers are 0 or 1
};

/// Facts of the window's voxels, row by row from the front. Shares no code with the stage: volumes are what lies above facets
/// that the six planes of a voxel have cut, along z, in rationals; samples are counted one by one.
std::vector<VoxelFacts> oracle_voxels(std::span<const Triangle> facets, const PixelGrid& grid, const Layer& layer,
                                      const VoxelWindow& window);

std::uint8_t oracle_level(const VoxelFacts& voxel, FillRule rule, std::uint32_t levels);

}  // namespace lamina::test
