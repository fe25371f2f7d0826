// stages/dose/blue_noise.h: an order of the pixels of a tile whose first ones, however many, lie evenly and without a grid.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/drop_image.h"

namespace lamina::dose {

inline constexpr std::uint32_t kTilePixels = kTileSide * kTileSide;

/// The rank of each pixel of the tile, row by row: each of 0 .. kTilePixels - 1 once. The pixels of rank below n are those
/// that are set for the share n / kTilePixels.
///
/// They are data (blue_noise_tile.h) of the void-and-cluster method: tests/dose/void_and_cluster.cpp.
/// cost  some microseconds at the first call, nothing after it; safe from any thread
const std::vector<std::uint16_t>& blue_noise_ranks();

/// How far the tile is moved from layer to layer. Of all odd steps this one was found to have the least correlation, over 18
/// shares from 0.02 to 0.98, between a layer and the eight above it; it comes back to its place after 128 layers.
struct TileShift {
  std::uint32_t column = 0, row = 0;
};
constexpr TileShift tile_shift(std::uint32_t layer) {
  return {layer % kTileSide * 111 % kTileSide, layer % kTileSide * 9 % kTileSide};
}

}  // namespace lamina::dose
