// stages/data/drop_image.h: drops of the pixels of a layer as zones with patterns, so that no list of dithered pixels exists.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/data/buffer.h"
#include "stages/data/levels.h"

namespace lamina {

/// Side of a tile, which repeats along columns and rows: a row of it is two words.
inline constexpr std::uint32_t kTileSide = 128;
inline constexpr std::uint32_t kTileWords = 2 * kTileSide;

/// Pixels of a zone get `base` drops, and those of its pattern one more. The base of a core is 0.
struct DropZone {
  enum class Extra : std::uint8_t { kNone, kTile, kCore };
  std::uint8_t base = 0;
  Extra extra = Extra::kNone;
  std::uint8_t tile = 0;  // number of the tile
};

/// The pixels of a word of a core: those of the lowest value of an interval, and two that turn from a value on.
struct CoreWord {
  std::uint64_t bits = 0;
  std::uint32_t turn[2] = {};
  std::uint8_t bit[2] = {};
};

/// Pixels with column * column_step + row * row_step + first < threshold, modulo 2^32.
struct CorePattern {
  std::uint32_t column_step = 0, row_step = 0, first = 0, threshold = 0;
  std::uint32_t of_row(std::uint32_t row) const { return row * row_step + first; }

  Buffer<CoreWord> words;  // by the high bits of the value of their first pixel; empty before tabulate() (geometry/drop_rows.h)
  std::uint32_t words_step = 0, words_threshold = 0;  // that they are of
};

struct DropPatterns {
  std::vector<DropZone> zone;  // by level; [0] is not read
  Buffer<std::uint64_t> tile;  // kTileWords each: bit c % 64 of word 2 (r % 128) + c / 64 % 2 is column c of row r
  CorePattern core;
  bool edges_alone = false;  // full voxels get whole drops: tiles are those of the edges of parts

  const std::uint64_t* tile_row(const DropZone& of, std::uint32_t row) const {
    return tile.data() + of.tile * std::size_t{kTileWords} + std::size_t{2} * (row % kTileSide);
  }
  std::uint64_t bytes() const { return zone.capacity() * sizeof(DropZone) + bytes_held(tile) + bytes_held(core.words); }
};

/// Borrowed drops of one image. The level of a run is the number of its zone.
struct DropImageView {
  LevelsView zones;
  const DropPatterns* patterns = nullptr;
};

}  // namespace lamina
